"""Steps of kicks and drifts, with constraints too."""
