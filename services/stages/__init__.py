"""One module a stage of the main job: what it makes and from what. `services.pipeline` orders them."""
