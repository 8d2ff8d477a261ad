"""The files of a run, and everything that reads them.

- ``settings``: a run's settings; ``seeds``: its random streams; ``lock``: one writer at a time.
- ``checkpoint``: atomic files; ``metrics``: the curves as a table.
- ``robot``: one evolved robot; ``champion``, ``elites``, ``published``: those from a run, from its
  archive and from the package; ``sources``: loads any of them.
- ``assessment`` and ``statistics``: tests on fresh episodes (paper section 6).
- ``exports``: CSV and pyribs; ``wording``: numbers as text.
"""
