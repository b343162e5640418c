"""A whole service of real processes, to be killed at chosen moments.

Modules:

    injected/   puts `probe` into every process, through PYTHONPATH; no product code knows of it
    probe       where a process is: traced, and held at a gate while a test looks or kills
    bodies      stand-ins for the stages' own work: quick, with real artifacts; all around them is the real thing
    disk        a store that can be full
    arena       the processes, their database and store
    settled     what must hold once the jobs have ended
"""
