#!/usr/bin/env python3
"""Tests of tools/check-docs: what counts as a command, as a marked block, and as the same output."""

import importlib.machinery
import importlib.util
import os
import sys
import unittest

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tools", "check-docs")


def load():
    sys.dont_write_bytecode = True
    loader = importlib.machinery.SourceFileLoader("check_docs", SCRIPT)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("check_docs", loader))
    loader.exec_module(module)
    return module


docs = load()


class CheckDocs(unittest.TestCase):
    def test_times_may_differ_but_words_digests_and_counts_of_contacts_may_not(self):
        self.assertTrue(docs.agree(["frame  mean 1.65 ms"], ["frame  mean 12.70 ms"]))
        self.assertFalse(docs.agree(["frame  mean 1.65 ms"], ["frame  median 1.65 ms"]))
        self.assertFalse(docs.agree(["digest 372f14146b8721b6"], ["digest 372f14146b8721b7"]))
        self.assertFalse(docs.agree(["the digest is 372f14146b8721b6"], ["the digest is 372f14146b8721b7"]))
        self.assertFalse(docs.agree(["contacts  12 in total"], ["contacts  13 in total"]))

    def test_missing_and_additional_lines_are_found(self):
        self.assertFalse(docs.agree(["a"], ["a", "b"]))
        self.assertFalse(docs.agree(["a", "b"], ["a"]))

    def test_three_dots_stand_for_any_lines(self):
        self.assertTrue(docs.agree(["a", "...", "d"], ["a", "b", "c", "d"]))
        self.assertFalse(docs.agree(["a", "...", "d"], ["a", "b", "c"]))

    def test_a_block_has_the_notes_of_the_comments_directly_before_it(self):
        lines = ["<!-- not run: needs root -->", "```console", "$ a", "```", "text", "```console", "$ b", "```"]
        first, second = docs.blocks_of(lines)
        self.assertEqual(first.notes, {"not run": "needs root"})
        self.assertEqual(second.notes, {})

    def test_a_command_continues_after_a_backslash_and_has_the_lines_up_to_the_next_as_output(self):
        (block,) = docs.blocks_of(["```console", "$ a \\", "  b", "out", "$ c", "```"])
        found = [(command, shown) for command, shown, _, _ in block.commands()]
        self.assertEqual(found, [("a   b", ["out"]), ("c", [])])

    def test_commands_are_recognised_where_they_are_not_marked(self):
        for line in ("$ anything", "tools/run", "  ringfence run", "cmake --preset release", "build/release/bin/x --y"):
            self.assertTrue(docs.COMMAND.match(line), line)
        for line in ("digest 1", "frame,object,x", "interface=eth0", "position_update (M2) ->"):
            self.assertFalse(docs.COMMAND.match(line), line)


if __name__ == "__main__":
    unittest.main()
