"""The step of collocation methods for separable Lagrangians, in their second-order form."""
