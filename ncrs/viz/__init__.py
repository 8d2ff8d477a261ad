"""Pictures of robots and runs: recordings, stills, films, figures, and a window to play in.

Needs the extra ``viz``, except for ``recording``, ``pictures``,
``stills`` and ``options``.
"""
