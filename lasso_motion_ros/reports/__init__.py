"""Pages, figures, pictures and videos made from what was measured."""
