"""Every tracker with weights, with each stabilization, under shake."""
