"""A scene computed in many ways: error against time."""
