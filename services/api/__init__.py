"""The REST interface; `application.create_app` makes it over a `Service`."""
