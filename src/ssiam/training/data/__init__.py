"""Training data: readers, copy-paste scenes, random patches, and the batches sampled from them."""
