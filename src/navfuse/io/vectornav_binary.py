"""The binary protocol of VectorNav sensors: packets that begin with 0xFA.

::

    FA | groups | mask of each group | fields of each group in order of their bits | CRC-16, high byte first

Groups are bits of a byte, fields bits of 16-bit masks; bit 7 of the byte and bit 15 of a mask say that another byte,
another mask follows. The CRC (polynomial 0x1021, start 0) goes over everything but the FA. All other numbers are
little-endian. Fields are those of :mod:`navfuse.io.vectornav_fields`.
"""

from __future__ import annotations

import os
import warnings
from binascii import crc_hqx
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.tables import check_file
from navfuse.io.vectornav_ascii import SENTENCE, parse_sentences, without_sentences
from navfuse.io.vectornav_fields import GROUPS, Field, fixed_type
from navfuse.io.vectornav_messages import Damage, Messages, VectorNavLog

Array = np.ndarray

EXTENSIONS = (".bin", ".vn", ".vnbin", ".dat", ".raw", ".log")
SYNC = 0xFA

_MAX_GROUP_BYTES = 2
_MAX_MASKS = 2
_CRC_BYTES = 2


class Layout(NamedTuple):
    """What a packet holds.

    Attributes
    ----------
    header : bytes
        Group byte and masks, without the FA.
    fields : tuple of (str, Field)
        With the names of their groups, in order.
    """

    header: bytes
    fields: tuple[tuple[str, Field], ...]

    @property
    def is_fixed(self) -> bool:
        """Whether all packets of the kind have one length."""
        return all(field.rows is None for _, field in self.fields)

    def dtype(self) -> np.dtype:
        """Of the payload, if that is fixed."""
        return np.dtype([(name, fixed_type(field)) for name, field in self.fields])


def layout_of(names: Sequence[str]) -> Layout:
    """The layout of packets that hold these fields.

    Parameters
    ----------
    names : sequence of str
        ``group.field_unit``, in any order.

    Raises
    ------
    ConfigError
        For an unknown name, or none at all.
    """
    known = {f"{group}.{field.name}": (g, b) for g, (group, fields) in GROUPS.items() for b, field in fields.items()}
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        raise ConfigError(f"a packet holds one or more of {', '.join(known)}; not {', '.join(unknown) or 'nothing'}")
    masks: dict[int, int] = {}
    for name in names:
        group, bit = known[name]
        masks[group] = masks.get(group, 0) | 1 << bit
    groups = sum(1 << group for group in masks)
    header = bytes([groups])
    for group in sorted(masks):
        mask = masks[group]
        low, high = mask & 0x7FFF, mask >> 16
        header += (low | (0x8000 if high else 0)).to_bytes(2, "little")
        header += high.to_bytes(2, "little") if high else b""
    layout = _layout(header)
    assert layout is not None
    return layout


def packet(layout: Layout, values: Mapping[str, Any]) -> bytes:
    """A packet with its checksum.

    Parameters
    ----------
    layout : Layout
    values : mapping of str to array-like
        A value for every field; of one with rows the pair (what stands before them, rows).
    """
    body = layout.header
    for name, field in layout.fields:
        value = values[name]
        if field.rows is None:
            body += np.asarray(value, fixed_type(field).base).tobytes()
        else:
            before, rows = value
            body += np.asarray(before, fixed_type(field)).tobytes() + np.asarray(rows, np.dtype(field.rows)).tobytes()
    return bytes([SYNC]) + body + crc_hqx(body, 0).to_bytes(2, "big")


def read_vectornav_binary(path: str | os.PathLike[str]) -> VectorNavLog:
    """Read every packet of a file, and the sentences between them.

    Bytes that belong to no packet with a right checksum are skipped, counted and warned about once.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    VectorNavLog

    Raises
    ------
    InputError
        If the file cannot be read or has no sound packet.

    Warns
    -----
    NavfuseWarning
        If bytes were skipped.
    """
    file = check_file(path, EXTENSIONS)
    log = parse_packets(file.read_bytes(), str(file))
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    return log


def parse_packets(data: bytes, source: str) -> VectorNavLog:
    """The packets of a file's bytes; see :func:`read_vectornav_binary`."""
    payloads: dict[bytes, list[bytes]] = {}
    gaps: list[tuple[int, int]] = []
    end = checksum = cut = 0
    for start, stop, header in _packets(data):
        if start > end:
            gaps.append((end, start))
        payloads.setdefault(header, []).append(data[start + 1 + len(header) : stop - _CRC_BYTES])
        end = stop
    if end < len(data):
        gaps.append((end, len(data)))
    messages = {}
    for header, parts in payloads.items():
        layout = _layout(header)
        assert layout is not None
        kind = f"fa {header.hex(' ')}"
        messages[kind] = Messages(kind, _decoded(layout, parts), np.full(len(parts), np.nan), np.arange(len(parts)))
    skipped, first = 0, ""
    for begin, stop in gaps:
        lost = len(without_sentences(data[begin:stop]))
        if lost:
            skipped += lost
            first = first or f"at byte {begin}"
            whole = _frame(data, begin, stop)
            checksum += whole == "checksum"
            cut += whole == "cut"
    if not payloads:
        raise InputError(_nothing(data, source))
    text = b"\n".join(data[begin:stop] for begin, stop in gaps)
    if SENTENCE.search(text):
        with suppress(InputError):
            messages |= parse_sentences(text, source).messages
    notes = []
    if skipped:
        packets = sum(map(len, payloads.values()))
        notes.append(
            f"{source}: {skipped} of {len(data)} bytes belong to none of the {packets} sound packets and were skipped,"
            f" the first {first}; {checksum} gaps begin with a packet whose checksum is wrong, {cut} with one that is"
            " cut off"
        )
    return VectorNavLog(messages, Damage(checksum, cut, 0, skipped, first), source, tuple(notes))


def _packets(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Begin, end and header of every sound packet; after a broken one the search goes on one byte further."""
    at = data.find(SYNC)
    while at >= 0:
        header = _header(data, at + 1)
        stop = -1 if header is None else _end(data, at, header)
        if header is not None and 0 < stop <= len(data) and crc_hqx(data[at + 1 : stop], 0) == 0:
            yield at, stop, header
            at = data.find(SYNC, stop)
        else:
            at = data.find(SYNC, at + 1)


def _header(data: bytes, at: int) -> bytes | None:
    """Group byte and masks from `at` on, None if they are not complete or impossible."""
    stop, groups, shift = at, 0, 0
    for _ in range(_MAX_GROUP_BYTES):
        if stop >= len(data):
            return None
        byte = data[stop]
        groups |= (byte & 0x7F) << shift
        shift += 8
        stop += 1
        if not byte & 0x80:
            break
    else:
        return None
    if groups == 0:
        return None
    for _ in range(groups.bit_count()):
        for part in range(_MAX_MASKS):
            if stop + 2 > len(data):
                return None
            more = data[stop + 1] & 0x80
            stop += 2
            if not more:
                break
            if part == _MAX_MASKS - 1:
                return None
    return data[at:stop]


@lru_cache(maxsize=4096)
def _layout(header: bytes) -> Layout | None:
    """Fields of a packet by its header; None if one of them is unknown."""
    if header[0] & 0x80 or not header[0]:
        return None
    fields: list[tuple[str, Field]] = []
    at = 1
    for bit in range(7):
        if not header[0] >> bit & 1:
            continue
        mask = int.from_bytes(header[at : at + 2], "little")
        at += 2
        if mask & 0x8000:
            mask = mask & 0x7FFF | int.from_bytes(header[at : at + 2], "little") << 16
            at += 2
        group, known = GROUPS[bit]
        for place in range(32):
            if mask >> place & 1:
                if place not in known:
                    return None
                fields.append((f"{group}.{known[place].name}", known[place]))
    return Layout(header, tuple(fields)) if fields else None


def _end(data: bytes, at: int, header: bytes) -> int:
    """Index behind the packet that begins at `at`; -1 if its fields are unknown, beyond the data if it is cut off."""
    layout = _layout(header)
    if layout is None:
        return -1
    stop = at + 1 + len(header)
    for _, field in layout.fields:
        size = fixed_type(field).itemsize
        if field.rows is not None:
            if stop + size > len(data):
                return len(data) + 1
            before = np.frombuffer(data, fixed_type(field), 1, stop)[0]
            size += int(before["count"]) * np.dtype(field.rows).itemsize
        stop += size
    return stop + _CRC_BYTES


def _decoded(layout: Layout, payloads: list[bytes]) -> dict[str, Any]:
    if layout.is_fixed:
        table = np.frombuffer(b"".join(payloads), layout.dtype())
        return {name: np.ascontiguousarray(table[name]) for name, _ in layout.fields}
    columns: dict[str, list[Any]] = {name: [] for name, _ in layout.fields}
    rows: dict[str, list[Array]] = {name: [] for name, field in layout.fields if field.rows is not None}
    for payload in payloads:
        at = 0
        for name, field in layout.fields:
            kind = fixed_type(field)
            value = np.frombuffer(payload, kind.base, field.count, at)
            at += kind.itemsize
            columns[name].append(value[0] if field.count == 1 else value)
            if field.rows is not None:
                row = np.dtype(field.rows)
                count = int(value[0]["count"])
                rows[name].append(np.frombuffer(payload, row, count, at))
                at += count * row.itemsize
    values: dict[str, Any] = {
        name: np.array(columns[name], dtype=fixed_type(field).base) for name, field in layout.fields
    }
    for name, parts in rows.items():
        held = np.empty(len(parts), dtype=object)
        held[:] = parts
        values[f"{name}.rows"] = held
    return values


def _frame(data: bytes, begin: int, stop: int) -> str:
    """What a gap begins with."""
    header = _header(data, begin + 1) if data[begin] == SYNC else None
    if header is None:
        return ""
    end = _end(data, begin, header)
    return "" if end < 0 else "cut" if end > stop else "checksum"


def _nothing(data: bytes, source: str) -> str:
    unknown = broken = 0
    at = data.find(SYNC)
    while at >= 0:
        header = _header(data, at + 1)
        if header is not None:
            unknown += _layout(header) is None
            broken += _layout(header) is not None
        at = data.find(SYNC, at + 1)
    text = " There are VectorNav sentences in it: use read_vectornav_ascii" if b"$VN" in data else ""
    return (
        f"{source}: there is no sound VectorNav packet in its {len(data)} bytes ({data.count(SYNC)} bytes 0xFA,"
        f" {broken} of them before a known header, none with a right checksum).{text}"
    )


def is_vectornav_binary(path: Path) -> bool:
    """Whether there is a sound packet in a file."""
    return holds_packet(path.read_bytes())


def holds_packet(data: bytes) -> bool:
    """Whether there is a sound packet among some bytes."""
    return next(_packets(data), None) is not None
