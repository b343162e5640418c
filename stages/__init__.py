"""One module for each stage of a build: what it makes and from what. `services.pipeline` orders them."""
