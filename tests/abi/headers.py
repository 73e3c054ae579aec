# SPDX-License-Identifier: Apache-2.0
"""The headers of api/heddle -> their structures, constants and functions, for the checks of tests/abi."""
import pathlib
import re
import subprocess

COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)
TAG = re.compile(r"\[(main|record|any)-thread\]")


def preprocessed(header, compiler):
    """Text that `header` itself contributes after macros were expanded, without what it includes."""
    command = [compiler, "-E", "-xc", "-std=c11", f"-I{header.parent.parent}", str(header)]
    text, is_own = [], False
    for line in subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines():
        marker = re.match(r'# \d+ "([^"]*)"', line)
        if marker:
            is_own = marker.group(1) == str(header)
        elif is_own:
            text.append(line)
    return "\n".join(text)


def member_names(body):
    """Names of the members of a structure, in order."""
    names = []
    for declaration in body.split(";"):
        if not declaration.strip():
            continue
        pointer = re.search(r"\(\*\s*(\w+)\s*\)\s*\(", declaration)
        if pointer:
            names.append(pointer.group(1))
            continue
        for part in declaration.split(","):
            names.append(re.search(r"(\w+)\s*(?:\[[^\]]*\]\s*)*$", part.strip()).group(1))
    return names


def structures(header, compiler):
    """[(name, [members])] of every structure that the header defines."""
    text = preprocessed(header, compiler)
    found = []
    for match in re.finditer(r"\b(typedef\s+)?struct\s+(\w+)\s*\{(.*?)\}", text, re.S):
        name = match.group(2) if match.group(1) else f"struct {match.group(2)}"
        found.append((name, member_names(match.group(3))))
    return found


def constants(header):
    """Names of the integer constants that the header defines."""
    return re.findall(r"^#define (HEDDLE_\w+) +(?:0x[0-9a-fA-F]+|\d+)u?\b", header.read_text(), re.M)


def functions(header):
    """[(line, name, comment)] of every exported function, function pointer and function type of the header.

    The comment is the one above, or the one at the end of the line; functions that follow one another without an empty
    line or a comment share the first one's.
    """
    lines = header.read_text().splitlines()
    found, comment, i = [], "", 0
    while i < len(lines):
        line = lines[i].strip()
        if line.startswith(("/*", "//")):
            first = i
            while "*/" not in lines[i] and not line.startswith("//"):
                i += 1
            comment = " ".join(lines[first : i + 1])
        elif not line or line.startswith("#"):
            comment = ""
        else:
            first = i
            while not re.search(r"[;{}]\s*(/\*.*)?$", lines[i]) and i + 1 < len(lines):
                i += 1
            text = " ".join(lines[first : i + 1])
            code = COMMENT.sub(" ", text)
            pointer = re.search(r"\(\*\s*(\w+)\s*\)\s*\(", code)
            exported = re.search(r"HEDDLE_EXPORT\b.*?\b(\w+)\s*\(", code)
            if pointer or exported:
                own = " ".join(COMMENT.findall(text))
                found.append((first + 1, (pointer or exported).group(1), own if TAG.search(own) else comment))
            elif "{" in code or "}" in code or not code.strip():
                comment = ""
        i += 1
    return found
