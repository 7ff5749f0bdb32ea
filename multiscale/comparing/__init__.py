"""A scene computed at many levels: error against time."""
