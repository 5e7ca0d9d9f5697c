"""Parameters as ROS 2 sends them."""

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters


def value(thing):
    """A parameter's value as ROS 2 sends it."""
    if isinstance(thing, bool):
        return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=thing)
    if isinstance(thing, int):
        return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=thing)
    if isinstance(thing, float):
        return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=thing)
    return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=thing)


def put(room, **values):
    """Sets parameters (`__` stands for a dot); whether each was taken, and the reason if not."""
    parameters = [Parameter(name=name.replace("__", "."), value=value(one)) for name, one in values.items()]
    answer = room.call(SetParameters, "/sweepd/set_parameters", SetParameters.Request(parameters=parameters))
    return [(result.successful, result.reason) for result in answer.results]


def set_parameter(room, name, one):
    """Sets one that is taken."""
    ((done, reason),) = put(room, **{name: one})
    assert done, reason
