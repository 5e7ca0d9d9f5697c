"""The lists of pairs and of contacts, kept from ``changes`` and ``contact_changes``.

Messages are applied in order, and none is applied to a list that it is not for.
"""

import numpy as np

from . import layout

#: Messages that are passed over while the whole list is awaited, before the port is opened anew.
_PATIENCE = 8
_PAIR = np.dtype(layout.PairRow)
_CONTACT = np.dtype(layout.ContactRow)
_TOLD = int(layout.PairFlags.SWEPT_HIT | layout.PairFlags.SWEPT_OPEN)


def has_left(rows):
    """Which rows of ``changes`` say that their pair is no longer listed; any other row replaces the pair's row."""
    quiet = (rows["events"] == 0) & (rows["flags"] & _TOLD == 0)
    return quiet & (rows["verdict"] <= layout.Verdict.APART)


def _keys(rows):
    return zip(rows["body_a"].tolist(), rows["body_b"].tolist())


class _List:
    """A list that is kept from messages of what is new."""

    def __init__(self, row):
        #: Of the newest message that was applied; 0: none was.
        self.boot_id = self.tick = 0
        #: Whether nothing is missing.
        self.is_whole = False
        self._passed = 0
        self._replace(np.empty(0, row))

    def is_of(self, header):
        """Whether it is whole and belongs to this tick."""
        return self.is_whole and (self.boot_id, self.tick) == (header.boot_id, header.tick)

    def take(self, header, rows):
        """Applies a message. True if it is not for this list and the whole list must be requested."""
        message, had = header.message, self.is_whole
        # until all of it is applied: a signal may end this in the midst
        self.is_whole = False
        applied = True
        if header.base_tick == 0:
            self._set_tick(message)
            self._replace(rows)
        elif had and (self.boot_id, self.tick) == (message.boot_id, header.base_tick):
            self._set_tick(message)
            self._change(rows)
        else:
            applied = False
        # what the sender says of its list is checked, so that a fault of either side is found and mended
        self.is_whole = applied and len(self) == header.listed
        if self.is_whole:
            self._passed = 0
            return False
        self._passed += 1
        ask = had or self._passed >= _PATIENCE
        if ask:
            self._passed = 0
        return ask

    def _set_tick(self, message):
        self.boot_id, self.tick = message.boot_id, message.tick


class PairList(_List):
    """The rows of ``pairs``, built from ``changes``. The cost of applying a message is proportional to its rows."""

    def __init__(self):
        super().__init__(_PAIR)

    def __len__(self):
        return len(self._places)

    def rows(self):
        """The rows sorted by ids, with their ages as of the tick: a new array."""
        places = np.fromiter(self._places.values(), np.intp, len(self._places))
        rows = self._rows[places]
        ticks = np.uint64(self.tick) - self._sent[places]
        age = rows["bound_age_ticks"].astype(np.uint64) + ticks
        rows["bound_age_ticks"] = np.minimum(age, np.uint64(0xFFFF_FFFF))
        certified = (rows["verdict"] == layout.Verdict.NEAR) | (rows["verdict"] == layout.Verdict.COLLIDING)
        rows["certified_tick"][certified] += ticks[certified]
        return rows[np.lexsort((rows["body_b"], rows["body_a"]))]

    def _replace(self, rows):
        self._rows = rows.copy()
        self._sent = np.full(len(rows), self.tick, np.uint64)
        self._places = {key: place for place, key in enumerate(_keys(rows))}
        self._free = []

    def _change(self, rows):
        left = has_left(rows)
        taken = []
        for key, gone in zip(_keys(rows), left.tolist()):
            if gone:
                place = self._places.pop(key, None)
                if place is not None:
                    self._free.append(place)
                continue
            place = self._places.get(key)
            if place is None:
                if not self._free:
                    self._grow()
                place = self._places[key] = self._free.pop()
            taken.append(place)
        self._rows[taken] = rows[~left]
        self._sent[taken] = self.tick

    def _grow(self):
        had = len(self._rows)
        more = max(had, 64)
        self._rows = np.concatenate([self._rows, np.empty(more, _PAIR)])
        self._sent = np.concatenate([self._sent, np.zeros(more, np.uint64)])
        self._free.extend(range(had + more - 1, had - 1, -1))


class ContactList(_List):
    """The rows of ``contacts``, built from ``contact_changes``. Applying a message costs in proportion to its rows."""

    def __init__(self):
        super().__init__(_CONTACT)

    def __len__(self):
        return self._len

    def rows(self):
        """The rows in the order of ``contacts``: a new array."""
        pairs = [self._pairs[key] for key in sorted(self._pairs)]
        return np.concatenate(pairs) if pairs else np.empty(0, _CONTACT)

    def _replace(self, rows):
        self._pairs = {}
        self._len = 0
        self._change(rows)

    def _change(self, rows):
        begins = (rows["body_a"][1:] != rows["body_a"][:-1]) | (rows["body_b"][1:] != rows["body_b"][:-1])
        starts = np.flatnonzero(np.concatenate([[len(rows) > 0], begins]))
        firsts = rows[starts]
        gone = firsts["kind"] == layout.ContactKind.GONE
        for key, start, end, is_gone in zip(
            _keys(firsts), starts.tolist(), [*starts[1:].tolist(), len(rows)], gone.tolist()
        ):
            before = self._pairs.pop(key, None)
            self._len -= 0 if before is None else len(before)
            if not is_gone:
                # of its own: the message lies in shared memory, and a pair may stay for longer than the others of it
                self._pairs[key] = rows[start:end].copy()
                self._len += end - start
