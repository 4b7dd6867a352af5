"""The kinds of a guess that need no floor: a level on an axis, options, and rows of them."""

from __future__ import annotations

import numbers
from collections.abc import Collection, Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from pathlib import Path

from helpers.guesses.guess import Kind

HERE = Path(__file__).parent
YES, NO = {'yes', 'y', 'true'}, {'no', 'n', 'false'}
MOST_STEPS = 100  # of the keys, from one end of an axis to the other
FEW = 10  # whole numbers, at most, are a button each


@dataclass(frozen=True)
class Level:
    """A number on an axis from `low` to `high`, whole if both are whole, in `unit`.

    `marks` are other numbers on the axis, by what they are called there.

    Raises ValueError unless `low` is below `high`.
    """

    low: float
    high: float
    unit: str = ''
    marks: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f'An axis goes up, and this one from {self.low} to {self.high}.')

    @property
    def axis(self) -> tuple[float, float]:
        return self.low, self.high

    @property
    def is_whole(self) -> bool:
        return isinstance(self.low, int) and isinstance(self.high, int)

    @property
    def scripts(self) -> tuple[Path, ...]:
        return (HERE / 'level.js', HERE / 'options.js') if self.are_few else (HERE / 'level.js',)

    @property
    def are_few(self) -> bool:
        """Whether the numbers are so few that each has a button, and no axis is drawn."""
        return self.is_whole and self.high - self.low < FEW and not self.marks

    @property
    def asks(self) -> str:
        if self.are_few:
            return f'Choose the number of {self.unit}.' if self.unit else 'Choose a number.'
        return 'Put your line on the axis: click there, drag it, or press the arrow keys.'

    @property
    def forms(self) -> str:
        unit = f' ({self.unit})' if self.unit else ''
        kind = 'a whole number' if self.is_whole else 'a number'
        return f'Typed in place of the dots: {kind} from {self.low:g} to {self.high:g}{unit}.'

    def record(self) -> dict:
        step = 1 if self.is_whole else (self.high - self.low) / MOST_STEPS
        return {
            'kind': 'level',
            'low': self.low,
            'high': self.high,
            'unit': self.unit,
            'step': step,
            'marks': dict(self.marks),
            'few': self.are_few,
        }

    def picture(self) -> str:
        return ''

    def words(self) -> str:
        return f'An axis from {self.low:g} to {self.high:g} {self.unit}'.rstrip() + '.'

    def read(self, typed: object) -> float:
        """Return a number, also of a text such as '0,9 s'."""
        number = number_of(typed, self.unit)
        if number is None or (self.is_whole and number != int(number)):
            raise ValueError(f'{typed!r} is no answer. {self.forms}')
        if not self.low <= number <= self.high:
            raise ValueError(f'{typed!r} is not on the axis. {self.forms}')
        return int(number) if self.is_whole else number

    def told(self, value: float) -> float:
        return value

    def outcome(self, measured: float, run: object, tolerance: float) -> dict:
        return {'at': measured, 'tolerance': tolerance}

    def answer(self, outcome: Mapping) -> str:
        return '' if outcome['tolerance'] else f'{outcome["at"]}'


@dataclass(frozen=True)
class Options:
    """Some options, of which one is chosen, or `several`: any number, or just so many.

    `values` are the options by the words that a page shows. With `points`, where each of them is
    (x, y in m, the robot at 0, 0), they stand there.
    """

    values: Mapping[str, object]
    several: bool | int = False
    points: Mapping[str, tuple[float, float]] | None = None

    scripts = (HERE / 'options.js',)
    axis = None

    @property
    def asks(self) -> str:
        if self.several is True:
            return 'Choose all that you expect.'
        return f'Choose {self.several} of them.' if self.several else 'Choose one.'

    @property
    def forms(self) -> str:
        names = [repr(value) for value in self.values.values()]
        if self.several:
            return f'Typed in place of the dots: a list or a set, such as [{", ".join(names[:2])}].'
        return f'Typed in place of the dots: {", ".join(names[:-1])} or {names[-1]}.'

    def record(self) -> dict:
        several = self.several if self.several is not True else 0
        return {
            'kind': 'options',
            'names': [*self.values],
            'several': several if self.several is not False else None,
            'points': self.points and [self.points[name] for name in self.values],
        }

    def picture(self) -> str:
        return ''

    def words(self) -> str:
        return f'Options: {", ".join(self.values)}.'

    def read(self, typed: object) -> list[int] | int:
        """Return the place of an option, or the places of several, in their order."""
        if not self.several:
            [place] = self._places([typed])
            return place
        if isinstance(typed, str):
            typed = [
                part for part in typed.replace(',', ' ').split() if part not in ('and', 'none')
            ]
        elif not isinstance(typed, Collection) or isinstance(typed, Mapping):
            typed = [typed]
        places = sorted(set(self._places(typed)))
        if self.several is not True and len(places) != self.several:
            raise ValueError(f'These are {len(places)}, and {self.several} are asked for.')
        return places

    def _places(self, typed: Iterable) -> list[int]:
        found = []
        for one in typed:
            same = [
                i
                for i, (name, value) in enumerate(self.values.items())
                if is_same(one, value, name)
            ]
            if not same:
                raise ValueError(f'{one!r} is none of the options. {self.forms}')
            found.append(same[0])
        return found

    def told(self, value: list[int] | int) -> list[str] | str:
        names = [*self.values]
        return [names[place] for place in value] if isinstance(value, list) else names[value]

    def outcome(self, measured: object, run: object, tolerance: float) -> dict:
        """Return the places of what was measured. Raises ValueError for what is no option."""
        if self.several:
            return {'at': sorted(set(self._places([*measured])))}
        return {'at': self._places([measured])[0]}

    def answer(self, outcome: Mapping) -> str:
        at = outcome['at']
        names = [*self.values]
        return ', '.join(names[i] for i in (at if isinstance(at, list) else [at])) or 'none'


@dataclass(frozen=True)
class Ticks(Options):
    """Options that are cells of the table that comes: any number of them is ticked.

    `cells` are the names of the options by row and column. A row may lack a column.
    """

    cells: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @property
    def asks(self) -> str:
        return 'Tick each cell in which you expect it.'

    def record(self) -> dict:
        names = [*self.values]
        places = {
            name: {column: names.index(option) for column, option in row.items()}
            for name, row in self.cells.items()
        }
        return super().record() | {'table': _table(places, None)}

    def came(self, texts: Mapping[str, str | Mapping[str, str]]) -> dict:
        """Return the table that has come, as the script shows it.

        `texts` are by the options, or by row and column, which may be more than were asked about.
        """
        if all(isinstance(text, str) for text in texts.values()):
            texts = {
                name: {column: texts.get(option, '') for column, option in row.items()}
                for name, row in self.cells.items()
            }
        return _table(texts, '')


@dataclass(frozen=True)
class Rows:
    """A row for each thing that is asked about, by its name, and one option chosen in each."""

    rows: Mapping[str, Options]

    scripts = (HERE / 'rows.js', HERE / 'options.js')
    axis = None
    asks = 'Choose one in each row.'

    @property
    def forms(self) -> str:
        first = [repr(next(iter(one.values.values()))) for one in self.rows.values()]
        return (
            f'Typed in place of the dots: a list, one for each row, such as [{", ".join(first)}].'
        )

    def record(self) -> dict:
        rows = [{'name': name, 'names': [*one.values]} for name, one in self.rows.items()]
        return {'kind': 'rows', 'rows': rows}

    def picture(self) -> str:
        return ''

    def words(self) -> str:
        return ' '.join(f'{name}: {one.words()}' for name, one in self.rows.items())

    def read(self, typed: object) -> list[int]:
        """Return the place of an option for each row, of a list or of a dict with their names."""
        if isinstance(typed, str):
            words = typed.replace(',', ' ').split()
            typed = words if len(words) == len(self.rows) else [*''.join(words)]
        if isinstance(typed, Mapping) and set(typed) == set(self.rows):
            typed = [typed[name] for name in self.rows]
        if not isinstance(typed, Sequence) or len(typed) != len(self.rows):
            raise ValueError(f'{typed!r} is no answer for {len(self.rows)} rows. {self.forms}')
        return [one.read(each) for one, each in zip(self.rows.values(), typed, strict=True)]

    def told(self, value: list[int]) -> list[str]:
        rows = zip(self.rows.items(), value, strict=True)
        return [f'{name}: {one.told(place)}' for (name, one), place in rows]

    def outcome(self, measured: object, run: object, tolerance: float) -> dict:
        """Return the places of what was measured. Raises ValueError for what is no option."""
        return {'at': self.read(measured)}

    def answer(self, outcome: Mapping) -> str:
        rows = zip(self.rows.values(), outcome['at'], strict=True)
        return ', '.join(one.told(place) for one, place in rows)


def kind_of(
    on: object,
    several: bool | int = False,
    unit: str = '',
    marks: Mapping[str, float | tuple[float, float]] | None = None,
) -> Kind:
    """Return the kind of a guess that `on` names: `bool`, an axis, options, or rows of them.

    With a unit, a pair of numbers is an axis. A dict of options is several rows, and a dict of
    dicts a table whose cells are ticked. `marks` are numbers on the axis, or the points of the
    options, by their names.

    Raises TypeError for anything else.
    """
    if isinstance(on, Level | Options | Rows):
        return on
    if unit and isinstance(on, tuple) and len(on) == 2:
        return Level(*map(float, on), unit, marks or {})
    if isinstance(on, range) and not several:
        return Level(on[0], on[-1], unit, marks or {})
    if isinstance(on, Mapping) and on and all(isinstance(row, Mapping) for row in on.values()):
        return _ticks(on)
    if isinstance(on, Mapping) and on and all(map(_is_options, on.values())):
        return Rows({name: _options(one) for name, one in on.items()})
    if isinstance(on, Mapping) or _is_options(on):
        return _options(on, several, marks)
    raise TypeError(f'A guess is made on a floor, an axis or options, not on {on!r}.')


def _is_options(on: object) -> bool:
    return on is bool or (
        isinstance(on, Collection) and not isinstance(on, str | Mapping) and len(on) > 1
    )


def _options(on: object, several: bool | int = False, points: Mapping | None = None) -> Options:
    if on is bool:
        return Options({'yes': True, 'no': False})
    if isinstance(on, Mapping):
        return Options(dict(on), several, points)
    values = sorted(on, key=str) if isinstance(on, AbstractSet) else on
    return Options({str(value): value for value in values}, several, points)


def _table(rows: Mapping[str, Mapping[str, object]], empty: object) -> dict:
    """Return the columns of all rows, and of each row its name and what its cells hold."""
    columns = list(dict.fromkeys(column for row in rows.values() for column in row))
    cells = [[name, [row.get(column, empty) for column in columns]] for name, row in rows.items()]
    return {'columns': columns, 'rows': cells}


def _ticks(on: Mapping[str, Mapping[str, object]]) -> Ticks:
    values = [value for row in on.values() for value in row.values()]
    named = {
        name: {column: str(value) for column, value in row.items()} for name, row in on.items()
    }
    return Ticks({str(value): value for value in values}, True, cells=named)


def number_of(typed: object, unit: str = '') -> float | None:
    """Return the number that was typed, also as a text with its unit; None if it is none."""
    if isinstance(typed, str):
        text = typed.strip().removesuffix(unit).strip().replace(',', '.')
        try:
            typed = float(text)
        except ValueError:
            return None
    if isinstance(typed, bool) or not isinstance(typed, numbers.Real):
        return None
    return float(typed)


def is_same(typed: object, value: object, name: str) -> bool:
    """Return whether what was typed means this option: 'no' is False, and 'a' is 'A'."""
    if isinstance(typed, str):
        text = typed.strip().casefold()
        if isinstance(value, bool):
            return text in (YES if value else NO)
        return text in (name.casefold(), str(value).casefold())
    if isinstance(value, bool) != isinstance(typed, bool):
        return False
    return bool(typed == value)
