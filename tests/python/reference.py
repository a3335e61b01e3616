"""Writes docs/python.md from the docstrings of the package.

    python tests/python/reference.py

`tests/python/package` checks that the page is up to date.
"""

import inspect
import pathlib
import re

import curvelax

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/python.md"
HEAD = """# Python reference

Every public name of the package `curvelax`, from its docstrings. [The package](../python/README.md) has the
introduction, and the [flags](flags.md) are the keys that `run` takes.

<!-- Generated from the package: python tests/python/reference.py -->
"""


def text(docstring):
    """A docstring in NumPy's style as Markdown."""
    text = inspect.cleandoc(docstring)
    text = re.sub(r":(?:func|class|meth|attr):`~?([^`]*)`", r"``\1``", text).replace("``", "`")
    # Doctests are code.
    examples = re.compile(r"(?:^>>> .*\n?(?:^.+\n?)*)+", re.MULTILINE)
    text = examples.sub(lambda code: f"```python\n{code[0].rstrip()}\n```\n", text)
    lines, terms = [], False
    for line, following in zip(text.split("\n"), [*text.split("\n")[1:], ""]):
        if re.fullmatch(r"-{3,}", line):
            continue
        if re.fullmatch(r"-{3,}", following):
            terms = line != "Examples"
            lines += [f"**{line}**", ""]
        elif terms and line and not line.startswith(" "):
            lines.append(f"- `{line}`:")
        elif terms and line:
            lines.append(f"  {line.strip()}")
        else:
            lines.append(line)
    return "\n".join(lines).strip()


def signature(name, value):
    """The call of a function or class, without types."""
    try:
        parameters = inspect.signature(value).parameters.values()
    except (TypeError, ValueError):
        return name
    plain = [own.replace(annotation=inspect.Parameter.empty) for own in parameters if own.name != "self"]
    return name + str(inspect.Signature(plain))


def members(kind):
    """The public attributes that a class defines itself, in the order of its text."""
    for name, value in vars(kind).items():
        value = getattr(value, "func", value)
        if not name.startswith("_") and inspect.getdoc(value):
            yield name, value


def page():
    """The whole page."""
    parts = [HEAD]
    for name in sorted(curvelax.__all__, key=str.lower):
        value = getattr(curvelax, name)
        if name == "__version__":
            parts.append("## `curvelax.__version__`\n\nThe version, as of the program.")
            continue
        is_error = inspect.isclass(value) and issubclass(value, BaseException)
        call = name if is_error or name in ("Study", "Picture") else signature(name, value)
        parts.append(f"## `curvelax.{call}`\n\n{text(value.__doc__)}")
        if is_error:
            parts.append("Bases: " + ", ".join(f"`{base.__name__}`" for base in value.__mro__[1:-2]) + ".")
        if name in ("Study", "Picture"):
            for own, item in members(value):
                call = signature(own, item) if inspect.isfunction(vars(value)[own]) else own
                parts.append(f"### `{name}.{call}`\n\n{text(inspect.getdoc(item))}")
    return "\n\n".join(part.strip() for part in parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
