#!/usr/bin/env python3
"""Checks that the frames in the names of transforms agree.  Usage: tools/check/frames.py

By the convention of hal/geometry.hpp `T_a_b` maps coordinates in b to coordinates in a. So
  T_a_b * T_c_d               is refused unless b and c are one frame,
  T_a_b * p_c                 likewise (also for v, w and n; R_a_b and q_a_b count as T_a_b),
  T_a_d = T_a_b * T_b_c       is refused because the outer frames are a and c,
  T_a_b = T_b_a               is refused: .inverse() is missing.
`const SE3& T_odom_anchor = anchor.T_odom_cam` is how the pose of another object gets the name that a product needs.
The roles parent, child, target and source stand for any frame when a value is passed on, but not in a product:
`.T_parent_child = T_odom_base`, `const SE3& T_previous_cam = found.T_target_source`.
Inverses and transposes swap the frames. Digits tell instances of a frame (cam0, cam1): two numbers must agree, a name
without a number fits any. `// frames: REASON` on the line of the product excuses it.
"""
import re
import sys
from dataclasses import dataclass

import source

TOKEN = re.compile(r"[A-Za-z_]\w*|\d[\w.']*|->|::|==|!=|<=|>=|&&|\|\||[-+*/%^&|]=|\S")
TRANSFORM = re.compile(r"^[TRq]_(?P<left>[a-z]+\d*)_(?P<right>[a-z]+\d*)(?:_\w*)?$")
VECTOR = re.compile(r"^[pvwn]_(?P<left>[a-z]+\d*)(?:_\w*?)?(?:_in_(?P<expressed>[a-z]+\d*))?_?$")
EXCUSE = re.compile(r"//.*\bframes: \S")
SWAPPING = {"inverse", "transpose", "conjugate"}
KEEPING = {"rotation", "rotation_matrix", "toRotationMatrix", "matrix", "linear", "adjoint", "cast", "value", "eval",
           "normalized", "get"}
TO_VECTOR = {"translation"}
# Names of roles that any frame may take when it is passed on.
ROLES = {"parent", "child", "target", "source", "from", "to"}
CLOSING = {"(": ")", "[": "]", "{": "}"}


@dataclass
class Operand:
    """One factor: its frames where its name tells them. A vector has no right frame, another expression neither."""

    text: str
    line: int
    left: str | None = None
    right: str | None = None
    known: bool = False


def agree(a, b):
    """One frame? `cam` fits `cam1`, `cam0` does not."""
    name_a, name_b = a.rstrip("0123456789"), b.rstrip("0123456789")
    digits_a, digits_b = a[len(name_a):], b[len(name_b):]
    return name_a == name_b and (digits_a == digits_b or not digits_a or not digits_b)


def fits(role, frame):
    """May a transform with this frame be given to a name with that one?"""
    return role in ROLES or frame in ROLES or agree(role, frame)


def tokenise(text):
    """(token, line) of C++ text without comments and literals."""
    tokens = []
    for number, line in enumerate(source.strip_code(text).splitlines(), 1):
        if not line.lstrip().startswith("#"):
            tokens += [(match.group(0), number) for match in TOKEN.finditer(line)]
    return tokens


def skip_brackets(tokens, i):
    """The index after the bracket that closes the one at i."""
    opening, depth = tokens[i][0], 0
    while i < len(tokens):
        if tokens[i][0] == opening:
            depth += 1
        elif tokens[i][0] == CLOSING[opening]:
            depth -= 1
            if depth == 0:
                return i + 1
        i += 1
    return i


def skip_template_arguments(tokens, i):
    """The index after `<…>` at i where it is followed by a call, else i."""
    depth, j = 0, i
    while j < len(tokens) and tokens[j][0] not in (";", "{", "}", "&&", "||"):
        depth += {"<": 1, ">": -1}.get(tokens[j][0], 0)
        j += 1
        if depth == 0:
            return j if j < len(tokens) and tokens[j][0] == "(" else i
    return i


def name_frames(operand, name):
    """Gives the operand the frames of its last name."""
    operand.left = operand.right = None
    transform, vector = TRANSFORM.match(name), VECTOR.match(name)
    operand.known = bool(transform or vector)
    if transform:
        operand.left, operand.right = transform["left"], transform["right"]
    elif vector:
        operand.left = vector["expressed"] or vector["left"]


def apply_call(operand, name):
    """What calling a method of that name makes of the operand's frames."""
    if name in SWAPPING and operand.right:
        operand.left, operand.right = operand.right, operand.left
    elif name in TO_VECTOR and operand.right:
        operand.right = None
    elif name not in KEEPING:
        operand.left = operand.right = None
        operand.known = False


def read_operand(tokens, i):
    """(operand, index after it) of the postfix expression that begins at i; (None, i) where none does."""
    while i < len(tokens) and tokens[i][0] in ("*", "&", "-"):
        i += 1
    if i >= len(tokens) or not re.match(r"[A-Za-z_0-9(]", tokens[i][0]):
        return None, i
    first, operand = i, Operand("", tokens[i][1])
    if tokens[i][0] == "(":
        i = skip_brackets(tokens, i)
    else:
        name_frames(operand, tokens[i][0])
        i += 1
    while i < len(tokens):
        token = tokens[i][0]
        if token in (".", "->", "::") and i + 1 < len(tokens):
            i += 2 if tokens[i + 1][0] == "template" else 1
            name = tokens[i][0]
            i = skip_template_arguments(tokens, i + 1)
            called = i < len(tokens) and tokens[i][0] == "("
            if called and not TRANSFORM.match(name):
                apply_call(operand, name)
            else:
                name_frames(operand, name)
        elif token in ("(", "["):
            i = skip_brackets(tokens, i)
        else:
            break
    operand.text = "".join(token for token, _ in tokens[first:i])
    return operand, i


def read_product(tokens, i):
    """(operands, index after) of `a * b * …` at i."""
    operands = []
    while True:
        operand, i = read_operand(tokens, i)
        if operand is None:
            return operands, i
        operands.append(operand)
        if i >= len(tokens) or tokens[i][0] != "*":
            return operands, i
        i += 1


def assigned(tokens, i):
    """The operand that the product at i is assigned to or initialises, where it is a named transform or vector."""
    if i < 2 or tokens[i - 1][0] not in ("=", "{"):
        return None
    name, line = tokens[i - 2]
    target = Operand(name, line)
    if re.match(r"[A-Za-z_]", name):
        name_frames(target, name)
    return target if target.known else None


def check_product(path, operands):
    """The inner frames of neighbouring factors."""
    for left, right in zip(operands, operands[1:]):
        if left.right and right.left and not agree(left.right, right.left):
            yield source.Finding(path, right.line, f"inner frames differ: {left.text} * {right.text}")


def check_assignment(path, target, operands):
    """The outer frames of a product that fills the whole right-hand side."""
    left, right = operands[0].left, operands[-1].right
    if len(operands) == 1 and re.search(r"(?:\.|->)[TRqpvwn]_", operands[0].text) and left == target.left:
        return
    same_kind = (target.right is None) == (right is None)
    if not all(operand.known for operand in operands) or not same_kind:
        return
    if not fits(target.left, left) or (right and not fits(target.right, right)):
        product = " * ".join(operand.text for operand in operands)
        yield source.Finding(path, operands[0].line, f"outer frames differ: {target.text} = {product}")


def check_range(path, tokens, first, last):
    """All products of tokens[first:last], and those inside their brackets."""
    i = first
    while i < last:
        if not re.match(r"[A-Za-z_]", tokens[i][0]):
            i += 1
            continue
        operands, end = read_product(tokens, i)
        yield from check_product(path, operands)
        target = assigned(tokens, i)
        if target and operands and end < len(tokens) and tokens[end][0] in (";", "}", ","):
            yield from check_assignment(path, target, operands)
        j = i
        while j < end:
            inside = tokens[j][0] in ("(", "[")
            after = skip_brackets(tokens, j) if inside else j + 1
            if inside:
                yield from check_range(path, tokens, j + 1, after - 1)
            j = after
        i = max(end, i + 1)


def check_file(path, text):
    tokens, lines = tokenise(text), text.splitlines()
    findings = check_range(path, tokens, 0, len(tokens))
    return [finding for finding in findings if not EXCUSE.search(lines[finding.line - 1])]


def check(project):
    return [finding for path, text in project.cpp() for finding in check_file(path, text)]


if __name__ == "__main__":
    sys.exit(source.main("frames", check, __file__))
