"""FMPy lets a unit run in a separate process. Arguments: the unit, inputs and outputs (.npz), plant steps at once.

The inputs file has `names` and `rows`; written are `rows` of the outputs named in `outputs`, one for each of its rows.
"""

import sys

import numpy
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave

unit, given, written, at_once = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
STEP_S = 0.00025
description = read_model_description(unit)
variables = {each.name: each for each in description.modelVariables}
folder = extract(unit)
fmu = FMU3Slave(
    guid=description.guid,
    unzipDirectory=folder,
    modelIdentifier=description.coSimulation.modelIdentifier,
    instanceName="driven",
)
# by type: value references, and the functions that set and get them
ACCESS = {
    "Float64": (fmu.setFloat64, fmu.getFloat64),
    "Int64": (fmu.setInt64, fmu.getInt64),
    "Boolean": (fmu.setBoolean, fmu.getBoolean),
}


def by_type(names):
    """{type: (columns, value references)}"""
    found = {}
    for column, name in enumerate(names):
        columns, references = found.setdefault(variables[name].type, ([], []))
        columns.append(column)
        references.append(variables[name].valueReference)
    return found


with numpy.load(given) as file:
    names, outputs, rows = list(file["names"]), list(file["outputs"]), file["rows"]
inward, outward = by_type(names), by_type(outputs)
fmu.instantiate()
fmu.enterInitializationMode(startTime=0.0)
fmu.exitInitializationMode()
result = numpy.zeros((len(rows) // at_once, len(outputs)))
for number in range(len(result)):
    row = rows[number * at_once]
    for kind, (columns, references) in inward.items():
        values = row[columns].tolist()
        ACCESS[kind][0](references, values if kind == "Float64" else [int(value) for value in values])
    fmu.doStep(currentCommunicationPoint=number * at_once * STEP_S, communicationStepSize=at_once * STEP_S)
    for kind, (columns, references) in outward.items():
        result[number, columns] = ACCESS[kind][1](references)
fmu.terminate()
fmu.freeInstance()
numpy.savez(written, rows=result)
