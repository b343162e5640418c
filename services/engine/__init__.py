"""Jobs as durable workflows (DBOS) on one machine or many.

Modules, from the bottom up:

    system      DBOS: its public calls and its documented table of workflows
    steering    the one function that changes DBOS from within: slots of a process, cheap looks, short waits
    queues      a queue for each role and one for checks, fair shares between jobs
    events      what happened in a job, numbered
    states      transitions of jobs, each one transaction
    task_states  transitions of tasks, the same
    problems    what can go wrong, in words
    progress    how far jobs are, and for how long still
    checks      checks of uploads, fair between keys
    jobs        what the API calls: submit, list, cancel, retry
    rooms       the folders that such a process sees, and what killed ones left
    child       the process that a task's body runs in
    children    the pool of such processes of a worker
    claims      what runs in this process now
    work        a task from claim to artifact
    runner      the pipeline's runner: tasks of a stage are queued, then waited for
    flow        the workflows
    liveness    heartbeats, and taking over from the dead
    housekeeping  retention
    runtime     all of it, started and stopped
"""
