"""Events of a run: what is sought on the motion within its steps, found, recorded, and reacted to.

`base` says what an event is and what it becomes for a system, `asked` has those of a run, `search` finds the zeros of
their functions, `seeking` goes along with the march of a run, and `log` keeps what was found. `stops` has the distances
at which a run ends, `bodies_left` what goes on after collisions, `functions` those of users, and `archived` what files
hold. The kinds of events are in files of their own.
"""
