"""Drafts of robots: bodies drawn for given measures, with controllers wired by hand.

They fill an archive with robots that work, for a search to start from or to beat.
"""
