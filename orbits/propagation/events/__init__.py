"""Events of a run: what is sought on the motion within its steps, found, recorded, and reacted to.

`base` says what an event is and what it becomes for a system, `search` finds the zeros of its function, `seeking` goes
along with the march of a run, and `log` keeps what was found. The kinds of events are in files of their own.
"""
