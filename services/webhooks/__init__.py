"""Webhooks: news of the service for other servers, signed after Standard Webhooks and delivered at least once.

Modules, from the bottom up:

    signature   secrets, and the headers that a receiver verifies
    schedule    when a delivery is tried again
    addresses   where a webhook may lead: nowhere inside, unless that is allowed
    sender      one attempt: one POST to an address that was checked
    outbox      what happened, written in the transaction in which it happened
    hooks       what the API calls: create, list, delete, test
    queue       deliveries that are due, each leased to one process
    deliverer   the thread that delivers them
"""
