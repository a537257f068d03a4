"""Virtual cameras against other stabilizers and plain crops: stillness, distance, smoothness."""
