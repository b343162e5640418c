"""What techniques cost and how well they do: pictures, benchmarks, reports, the viewer and advice, on files alone."""
