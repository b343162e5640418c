"""From label shards to a proven bundle: data, network, loss, training, evaluation, export, parity."""
