"""What ties the stages together: pipeline, artifact store, registry, report and command line."""
