"""The service's tables, in SQLite or PostgreSQL, through SQLAlchemy Core."""

from services.database.connection import Database, open_database

__all__ = ["Database", "open_database"]
