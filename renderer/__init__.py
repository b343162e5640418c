"""From a USD scene to fragments, images and metrics."""
