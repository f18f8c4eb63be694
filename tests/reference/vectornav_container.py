"""Real VectorNav data that another program keeps in a container of its own, put back into packets."""

import numpy as np

from navfuse.io.vectornav_binary import layout_of, packet, parse_packets
from navfuse.io.vectornav_fields import GROUPS, fixed_type


def contained(path):
    """Layout and contents of a file in which another program keeps the fields of VectorNav packets as they came.

    Six masks (time, IMU, GNSS 1, attitude, INS, GNSS 2), then for every packet week cycle, week and time of week, and
    the fields; the reserved bytes of the fields with rows are left out.
    """
    data = path.read_bytes()
    names = []
    for bit, mask in zip(range(1, 7), np.frombuffer(data, "<u4", 6), strict=True):
        group, known = GROUPS[bit]
        names += [f"{group}.{known[place].name}" for place in range(32) if mask >> place & 1 and place != 15]
    layout = layout_of(names)
    contents, at = [], 24
    while at < len(data):
        at += 16
        values = {}
        for name, field in layout.fields:
            kind = fixed_type(field)
            if field.rows is None:
                values[name] = np.frombuffer(data, kind.base, field.count, at).reshape(kind.shape)
                at += kind.itemsize
                continue
            told = np.frombuffer(data[at : at + kind.itemsize - 1] + b"\0", kind)[0]
            at += kind.itemsize - 1
            rows = np.frombuffer(data, np.dtype(field.rows), int(told["count"]), at)
            at += rows.nbytes
            values[name] = told, rows
        contents.append(values)
    assert at == len(data)
    return layout, contents


def real_packets(shared_data, name):
    """The log of packets made of such a file of the VN-310."""
    layout, contents = contained(shared_data / "instinct" / "VectorNav" / f"{name}.vnb")
    return parse_packets(b"".join(packet(layout, values) for values in contents), name)
