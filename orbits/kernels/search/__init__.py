"""What every search for approaches and passages needs: the osculating orbit of a pair, and its path within a step."""
