"""Things to look at: TensorBoard pictures, figures, films, and a window to play in.

TensorBoard needs nothing beyond the package; the rest needs the extra ``viz``.
"""
