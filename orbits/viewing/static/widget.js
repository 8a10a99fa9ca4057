// The view in a notebook, as anywidget asks for it.

import { View } from "./view.js";

export const widget = {
  render({ model, el }) {
    const root = document.createElement("div");
    root.className = "orbits-view orbits-widget";
    el.append(root);
    const view = new View(root, model.get("data"));
    return () => view.dispose();
  },
};
