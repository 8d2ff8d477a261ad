"""Everything that a run leaves behind, and everything that reads it.

- ``settings``: a run's settings; ``seeds``: its random streams; ``lock``: one writer at a time.
- ``checkpoint``: atomic files; ``metrics``: the curves as a table.
- ``champion``, ``elites``, ``published``: robots, from a run or from the package.
- ``assessment`` and ``statistics``: tests on fresh episodes (section 6).
- ``exports``: CSV and pyribs; ``text``: numbers as people read them.
"""
