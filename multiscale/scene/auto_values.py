"""Keys of a scene that may be left to the plan: their value or ``"auto"``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

Open = Literal["auto"]
"""What a key that is left to the plan says."""


@dataclass(frozen=True)
class OrAuto:
    """Lets ``"auto"`` pass beside the values of a type, whose own errors stay as they are.

    Args:
        values: The type of all other values.
    """

    values: Any

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return a schema that asks the type's own only for other values."""
        return core_schema.no_info_wrap_validator_function(
            _checked,
            handler.generate_schema(self.values),
            serialization=core_schema.plain_serializer_function_ser_schema(_unchanged),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON Schema of both."""
        return {"anyOf": [{"const": "auto"}, handler(schema)]}


def _checked(value: Any, check: core_schema.ValidatorFunctionWrapHandler) -> Any:
    return value if isinstance(value, str) and value == "auto" else check(value)


def _unchanged(value: Any) -> Any:
    return value
