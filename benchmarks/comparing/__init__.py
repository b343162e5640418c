"""The committed suite: which scenes, and the page that reads its results like a paper."""
