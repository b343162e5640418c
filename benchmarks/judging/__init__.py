"""Storm as judge of the loader: what it shows of a stage without light, against what is loaded here."""
