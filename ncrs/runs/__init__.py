"""Everything that a run leaves behind, and everything that reads it.

- ``settings``: a run's settings; ``seeds``: its random streams; ``lock``: one writer at a time.
- ``checkpoint``: atomic files; ``metrics``: the curves as a table.
- ``robot``: one evolved robot; ``champion``, ``elites``, ``published``: what those from a run's
  champion, from its archive and from the package add; ``sources``: loads any of them.
- ``assessment`` and ``statistics``: tests on fresh episodes (section 6).
- ``exports``: CSV and pyribs; ``wording``: numbers as text for people.
"""
