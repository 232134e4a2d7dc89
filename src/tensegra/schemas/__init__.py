"""schemas: the two file formats, told to editors, to pages and to people who begin."""

from tensegra.schemas.published import NAMES, schema_text
from tensegra.schemas.starter import starter_structure, starter_study

__all__ = ["NAMES", "schema_text", "starter_structure", "starter_study"]
