"""What a reader sees of a figure, as boxes and texts: so that overlaps and labels can be tested without eyes.

All but `laid_out` and `texts` want a figure that is laid out.
"""

from __future__ import annotations

from itertools import pairwise


def laid_out(figure):
    """Give everything in a figure its place; return the figure."""
    figure.draw_without_rendering()
    return figure


def colliding_tick_labels(figure):
    """Return pairs of texts of neighbouring tick labels that overlap, of all axes."""
    renderer = figure.canvas.get_renderer()
    found = []
    for axes in figure.get_axes():
        for axis in (axes.xaxis, axes.yaxis):
            shown = [label for label in axis.get_ticklabels() if label.get_visible() and label.get_text()]
            low, high = sorted(axis.get_view_interval())
            shown = [label for label in shown if low <= label.get_position()[axis is axes.yaxis] <= high]
            boxes = [label.get_window_extent(renderer) for label in shown]
            found += [
                (one.get_text(), two.get_text())
                for (one, a), (two, b) in pairwise(sorted(zip(shown, boxes, strict=True), key=_place))
                if a.overlaps(b)
            ]
    return found


def texts(figure):
    """Return every text of a figure: titles, labels, legends, captions."""
    from matplotlib.text import Text

    return [text.get_text() for text in figure.findobj(Text) if text.get_visible() and text.get_text()]


def legends_on_panels(figure):
    """Return the axes whose panel, ticks and labels included, a legend of the figure or a caption covers."""
    renderer = figure.canvas.get_renderer()
    covers = [each.get_window_extent(renderer) for each in (*figure.legends, *figure.texts)]
    return [axes for axes in figure.get_axes() for cover in covers if cover.overlaps(axes.get_tightbbox(renderer))]


def outside(figure):
    """Return the legends, captions, and panels with titles and labels that stick out of the picture."""
    renderer = figure.canvas.get_renderer()
    width, height = figure.bbox.size
    boxes = [(each, each.get_window_extent(renderer)) for each in (*figure.legends, *figure.texts)]
    boxes += [(axes, axes.get_tightbbox(renderer)) for axes in figure.get_axes()]
    return [each for each, box in boxes if box.x0 < -1 or box.y0 < -1 or box.x1 > width + 1 or box.y1 > height + 1]


def titles_on_panels(figure):
    """Return the titles of panels that reach into another panel or the figures of its axes."""
    renderer = figure.canvas.get_renderer()
    titles = {axes: [text for text in (axes._left_title, axes.title) if text.get_text()] for axes in figure.get_axes()}
    return [
        text.get_text()
        for axes, own in titles.items()
        for text in own
        for other in titles
        if other is not axes and text.get_window_extent(renderer).overlaps(other.get_tightbbox(renderer))
    ]


def captions_on_legends(figure):
    """Return the captions that a legend of the figure overlaps."""
    renderer = figure.canvas.get_renderer()
    legends = [each.get_window_extent(renderer) for each in figure.legends]
    return [text for text in figure.texts if any(text.get_window_extent(renderer).overlaps(box) for box in legends)]


def _place(labelled):
    return labelled[1].x0, labelled[1].y0
