// The project's language: plain terms that docs/glossary.md defines, and none of the words in vocabulary.txt.
#include <cctype>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <doctest/doctest.h>

#include "docs/pages.hpp"

namespace ringfence::docs {
namespace {

struct Vocabulary {
  std::map<std::string, std::string, std::less<>> refused;  ///< by word, in lower case: what to write instead
  std::set<std::string, std::less<>> frozen;
  std::set<std::string, std::less<>> external;
};

Vocabulary read_vocabulary() {
  Vocabulary vocabulary;
  for (const std::string& line : lines_of(read_file(root / "tests/docs/vocabulary.txt"))) {
    if (line.empty() || line.starts_with('#')) {
      continue;
    }
    constexpr std::string_view frozen = "frozen ", external = "external ";
    if (line.starts_with(frozen)) {
      vocabulary.frozen.insert(line.substr(frozen.size()));
      continue;
    }
    if (line.starts_with(external)) {
      vocabulary.external.insert(line.substr(external.size()));
      continue;
    }
    const std::size_t colon = line.find(": ");
    REQUIRE_MESSAGE(colon != line.npos, "vocabulary.txt: neither \"WORD: REPLACEMENT\" nor \"frozen NAME\": " << line);
    vocabulary.refused.emplace(line.substr(0, colon), line.substr(colon + 2));
  }
  return vocabulary;
}

bool is_upper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }
bool is_alpha(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }

/// The words of a text in lower case, where `FrameDone`, `frame_done` and `frame done` are the same two words.
std::vector<std::string> words_of(std::string_view text) {
  std::vector<std::string> words;
  std::string word;
  const auto end_word = [&] {
    if (!word.empty()) {
      words.push_back(std::move(word));
    }
    word.clear();
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!is_alpha(text[i])) {
      end_word();
      continue;
    }
    const bool starts_word = i > 0 && is_upper(text[i]) && is_alpha(text[i - 1]) && !is_upper(text[i - 1]);
    if (starts_word) {
      end_word();
    }
    word += static_cast<char>(std::tolower(static_cast<unsigned char>(text[i])));
  }
  end_word();
  return words;
}

/// `line` without identifiers of other libraries, and without frozen names that follow a quotation mark, a backtick, a
/// slash, a vertical bar, or a colon as in `--fail F:N:NAME`.
std::string without_allowed_names(std::string line, const Vocabulary& vocabulary) {
  for (const std::string& name : vocabulary.external) {
    line = std::regex_replace(line, std::regex("\\b" + name + "\\b"), "");
  }
  for (const std::string& name : vocabulary.frozen) {
    for (std::size_t at = line.find(name); at != line.npos; at = line.find(name, at + 1)) {
      const char before = at > 0 ? line[at - 1] : ' ';
      const char after = at + name.size() < line.size() ? line[at + name.size()] : ' ';
      constexpr std::string_view quotes = "`\":|/";
      if (quotes.find(before) != quotes.npos && !is_alpha(after)) {
        line.erase(at, name.size());
      }
    }
  }
  return line;
}

bool is_checked(const std::filesystem::path& file) {
  if (file.generic_string().find("/node_modules/") != std::string::npos) return false;
  static const std::set<std::string> endings{".cpp", ".hpp", ".md",  ".cmake", ".txt",
                                             ".in",  ".idl", ".yml", ".json",  ""};
  const std::string name = file.generic_string();
  for (const char* excluded : {"docs/notes/", "docs/data/", "docs/cluster/", "docs/scaling/", "tests/fuzz/corpus/",
                               "tests/docs/vocabulary", "tools/ringfence/frozen_names"}) {
    if (name.starts_with(excluded)) {
      return false;
    }
  }
  return endings.contains(file.extension().string());
}

std::vector<std::filesystem::path> checked_files() {
  std::vector<std::filesystem::path> files;
  for (const char* folder : {"engine", "bench", "tests", "tools", "docs", ".ci", ".github"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      const std::filesystem::path file = entry.path().lexically_relative(root);
      if (entry.is_regular_file() && is_checked(file)) {
        files.push_back(file);
      }
    }
  }
  for (const char* file : {"README.md", "CONTRIBUTING.md", "CMakeLists.txt", "CMakePresets.json", ".clang-tidy"}) {
    files.emplace_back(file);
  }
  return files;
}

TEST_CASE("no file uses a word of vocabulary.txt outside frozen names") {
  const Vocabulary vocabulary = read_vocabulary();
  REQUIRE(vocabulary.refused.size() > 20);
  std::size_t words = 0;
  for (const std::filesystem::path& file : checked_files()) {
    int number = 0;
    for (const std::string& line : lines_of(read_file(root / file))) {
      ++number;
      for (const std::string& word : words_of(without_allowed_names(line, vocabulary))) {
        ++words;
        if (const auto found = vocabulary.refused.find(word); found != vocabulary.refused.end()) {
          FAIL_CHECK(file.generic_string() << ":" << number << ": \"" << word << "\"; write: " << found->second);
        }
      }
    }
  }
  CHECK(words > 100'000);
}

TEST_CASE("a listed word is found in prose and inside identifiers, a frozen name in quotation marks is not") {
  CHECK(words_of("ToldRecord told_mark RE-told") ==
        std::vector<std::string>{"told", "record", "told", "mark", "re", "told"});
  Vocabulary vocabulary;
  vocabulary.frozen = {"telling"};
  CHECK(without_allowed_names("`telling` \"telling\" --fail 3:1:telling", vocabulary) == "`` \"\" --fail 3:1:");
  CHECK(without_allowed_names("while telling it", vocabulary) == "while telling it");
}

/// The terms that the tables of docs/glossary.md define.
std::set<std::string> glossary_terms() {
  std::set<std::string> terms;
  for (const std::string& line : lines_of(read_file(root / "docs/glossary.md"))) {
    const std::size_t end = line.find(" |", 2);
    if (line.starts_with("| ") && end != line.npos) {
      terms.insert(line.substr(2, end - 2));
    }
  }
  return terms;
}

TEST_CASE("the glossary defines the terms of the paper and of the field, each once and in at most two sentences") {
  const std::set<std::string> terms = glossary_terms();
  for (const char* term : {"CD node", "user node", "avatar", "M1", "M2", "M3", "M4", "M5", "broad phase",
                           "candidate pair", "contact", "ghost", "host", "hand-over", "epoch", "replica"}) {
    CHECK_MESSAGE(terms.contains(term), "docs/glossary.md does not define " << term);
  }
  std::size_t rows = 0;
  const std::regex sentence_end(R"([.!?]( |$))");
  for (const std::string& line : lines_of(read_file(root / "docs/glossary.md"))) {
    if (!line.starts_with("| ") || line.starts_with("| term |")) {
      continue;
    }
    ++rows;
    const std::string meaning = line.substr(line.find(" | ") + 3, line.size() - line.find(" | ") - 5);
    const auto sentences =
        std::distance(std::sregex_iterator(meaning.begin(), meaning.end(), sentence_end), std::sregex_iterator());
    CHECK_MESSAGE((sentences >= 1 && sentences <= 2),
                  "docs/glossary.md: one or two sentences, not " << sentences << ": " << line);
  }
  CHECK_MESSAGE(rows + 1 == terms.size(), "docs/glossary.md defines a term twice");
}

TEST_CASE("README and every page of the documentation link to the glossary") {
  for (const Page& page : read_pages()) {
    if (page.name == "docs/glossary.md" || page.name == "CHANGELOG.md") {
      continue;
    }
    CHECK_MESSAGE(page.text.find("glossary.md)") != std::string::npos,
                  page.name << " does not link to docs/glossary.md");
  }
}

}  // namespace
}  // namespace ringfence::docs
