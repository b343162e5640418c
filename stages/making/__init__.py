"""How each stage is made, a module for each: `make` writes an artifact and returns its facts."""
