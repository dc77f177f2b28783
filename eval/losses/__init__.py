"""Why is a pose wrong? The first stage that would have to do better, and what it costs."""
