"""pya2l reads a description in a separate process, because its parser leaves descriptors open; prints JSON.

Argument: the file. It also prints whether a grammar that is cut off is refused.
"""

import json
import pathlib
import sys

from pya2l.parser import A2lError, A2lParser

text = pathlib.Path(sys.argv[1]).read_text(encoding="utf-8")
with A2lParser() as parser:
    module = parser.tree_from_a2l(text.encode()).PROJECT.MODULE[0]
    found = {
        "warnings": list(parser.warnings),
        "measurements": {each.Name.Value: each.ECU_ADDRESS.Address.Value for each in module.MEASUREMENT},
        "characteristics": {each.Name.Value: each.Address.Value for each in module.CHARACTERISTIC},
        "structs": sum(
            each.type_definition.type_name.WhichOneof("oneof") == "struct_type_name" for each in module.A2ML.Declaration
        ),
        "refused": False,
    }
    try:
        parser.tree_from_a2l(text.replace("taggedunion if_data {", "taggedunion {{", 1).encode())
    except A2lError:
        found["refused"] = True
print("FOUND " + json.dumps(found))
