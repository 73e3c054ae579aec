# SPDX-License-Identifier: Apache-2.0
"""What the headers promise and what the libraries of a build really export and need.

usage: abi_test.py SOURCE BUILD LAYOUT_PROGRAM COMPILER
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import headers

SOURCE, BUILD, LAYOUT, COMPILER = (sys.argv[1:] + [None] * 4)[:4]


def output(*command):
    return subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout


def exported(library):
    """Names of the dynamic symbols that the library defines."""
    lines = output("nm", "-D", "--defined-only", "--format=posix", library).splitlines()
    return sorted(line.split()[0].split("@")[0] for line in lines if line.split()[1] != "A")


def undefined(library):
    lines = output("nm", "-D", "--undefined-only", "--format=posix", library).splitlines()
    return [line.split()[0].split("@")[0] for line in lines]


def needed(library):
    return re.findall(r"\(NEEDED\).*\[(.*)\]", output("readelf", "-d", library))


def plugins():
    # Shipped ones, and the tests' own that heddle_plugin() built.
    folders = [pathlib.Path(BUILD) / "lib/heddle/plugins", pathlib.Path(BUILD) / "tests/abi/plugins"]
    return sorted(file for folder in folders for file in folder.glob("*/*/*.so"))


def header_files():
    return sorted((pathlib.Path(SOURCE) / "api/heddle").glob("*.h"))


class Headers(unittest.TestCase):
    maxDiff = None

    def test_every_structure_keeps_its_recorded_layout(self):
        recorded = (pathlib.Path(SOURCE) / "tests/abi/layout.txt").read_text()
        help_text = f"if the change is meant: {LAYOUT} > tests/abi/layout.txt"
        self.assertMultiLineEqual(recorded, output(LAYOUT), help_text)

    def test_every_structure_that_crosses_begins_with_its_size(self):
        # Records are arrays that the GPU reads: they have no room for it, and their sizes are fixed in records.h.
        for header in header_files():
            if header.name == "records.h":
                continue
            for name, members in headers.structures(header, COMPILER):
                self.assertEqual(members[0], "struct_size", f"{header.name}: {name}")

    def test_no_structure_has_an_enumeration_a_bool_or_a_bit_field(self):
        for header in header_files():
            text = headers.COMMENT.sub(" ", header.read_text())
            for word in (r"\benum\b", r"\b_?[Bb]ool\b", r"\w+\s*:\s*\d+\s*;"):
                self.assertIsNone(re.search(word, text), f"{header.name}: {word}")

    def test_every_function_says_its_thread(self):
        found = [(header.name, function) for header in header_files() for function in headers.functions(header)]
        missing = [
            f"{name}:{line}: {function}"
            for name, (line, function, comment) in found
            if not headers.TAG.search(comment)
        ]
        self.assertEqual(missing, [])
        # The reader of headers sees what the compiler sees: as many pointers as there are "(*" in the text.
        pointers = sum(
            len(re.findall(r"\(\*\s*\w+\s*\)\s*\(", headers.COMMENT.sub(" ", header.read_text())))
            for header in header_files()
        )
        exports = sum(
            len(re.findall(r"^HEDDLE_EXPORT", header.read_text(), re.M)) for header in header_files()
        )
        self.assertEqual(len(found), pointers + exports)
        self.assertGreater(len(found), 60)

    def test_a_function_without_a_tag_would_be_found(self):
        with tempfile.TemporaryDirectory() as folder:
            header = pathlib.Path(folder) / "h.h"
            header.write_text(
                "/* A. [any-thread] */\nHEDDLE_EXPORT int a(void);\nHEDDLE_EXPORT int b(int x,\n               int y);\n\n"
                "HEDDLE_EXPORT int c(void);\n/* D. */\nHEDDLE_EXPORT int d(void);\nstruct s {\n  /* E.\n"
                "   * [main-thread] */\n  int (*e)(void);\n  int x; /* no function */\n  int (*f)(void);\n\n"
                "  int (*g)(void); /* [record-thread] */\n};\n"
            )
            tagged = {name: bool(headers.TAG.search(text)) for _, name, text in headers.functions(header)}
            self.assertEqual(tagged, {"a": True, "b": True, "c": False, "d": False, "e": True, "f": True, "g": True})


class Plugins(unittest.TestCase):
    def test_export_nothing_but_their_entry(self):
        self.assertGreater(len(plugins()), 0)
        for library in plugins():
            self.assertEqual(exported(library), ["heddle_entry"], library)

    def test_have_no_thread_local_object_with_a_destructor(self):
        # It would keep the library mapped after dlclose for as long as a thread that touched it lives.
        for library in plugins():
            self.assertNotIn("__cxa_thread_atexit", undefined(library), library)

    def test_link_neither_vulkan_nor_the_host(self):
        for library in plugins():
            for name in needed(library):
                self.assertNotRegex(name, r"^lib(vulkan|heddle)", f"{library} needs {name}")
            foreign = [name for name in undefined(library) if re.match(r"(vk[A-Z]|heddle_)", name)]
            self.assertEqual(foreign, [], library)


class Host(unittest.TestCase):
    def library(self):
        return pathlib.Path(BUILD) / "lib/libheddle.so"

    def test_exports_what_its_header_declares_and_nothing_else(self):
        header = pathlib.Path(SOURCE) / "api/heddle/heddle.h"
        # The callbacks in heddle_host_options are members, not exports.
        declared = {name for _, name, _ in headers.functions(header)} - {"log", "progress"}
        self.assertEqual(exported(self.library()), sorted(declared))

    def test_needs_no_library_that_is_opened_only_on_demand(self):
        # The closure, not only the direct needs: another library could bring them in.
        lines = output("ldd", self.library()).splitlines()
        for line in lines:
            self.assertNotRegex(line.strip(), r"^lib(OpenImageIO|python|embree|vulkan|OpenColorIO)", line)

    def test_the_command_needs_the_library_alone(self):
        command = pathlib.Path(BUILD) / "bin/heddle"
        names = [name for name in needed(command) if "heddle" in name]
        self.assertEqual(names, ["libheddle.so.0"])
        self.assertEqual([name for name in undefined(command) if name.startswith("vk")], [])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v"])
