# SPDX-License-Identifier: Apache-2.0
"""layout.py COMPILER FOLDER: headers of api/heddle -> a C program that prints the layout of all they define.

The build runs it; `abi_layout > tests/abi/layout.txt` records a change that is meant.
"""
import pathlib
import sys

import headers


def main():
    compiler, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    files = sorted(folder.glob("*.h"))
    print("#include <stddef.h>\n#include <stdio.h>")
    for file in files:
        print(f"#include <heddle/{file.name}>")
    print("int main(void) {")
    for file in files:
        print(f'  puts("# {file.name}");')
        for name in headers.constants(file):
            print(f'  printf("{name} %lld\\n", (long long)({name}));')
        for name, members in headers.structures(file, compiler):
            print(f'  printf("{name} %zu bytes\\n", sizeof({name}));')
            for member in members:
                size = f"sizeof((({name}*)0)->{member})"
                print(f'  printf("  %3zu %3zu {member}\\n", offsetof({name}, {member}), {size});')
    print("  return 0;\n}")


main()
