// docs/client-protocol.md is what other clients are written from: its tables read what the codec writes.
#include <algorithm>
#include <bit>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "gateway/edge/edge_statistics.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "gateway/protocol/server_messages.hpp"

namespace ringfence::gateway {
namespace {

using Bytes = std::vector<std::byte>;

std::string read_document() {
  std::ifstream file(RINGFENCE_CLIENT_PROTOCOL);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}
const std::string document = read_document();

struct Field {
  std::string name, type, note;
};

/// The first table after a text.
std::vector<Field> table_after(const std::string& text) {
  const std::size_t at = document.find(text);
  REQUIRE_MESSAGE(at != std::string::npos, text);
  const std::size_t begin = document.find("\n| ", at) + 1, end = document.find("\n\n", begin);
  const std::string rows = document.substr(begin, end - begin);
  const std::regex row(R"(\| ([^|]*?) \| ([^|]*?) \|([^|]*)\|)");
  std::vector<Field> fields;
  for (std::sregex_iterator each(rows.begin(), rows.end(), row), none; each != none; ++each) {
    const Field field{(*each)[1], (*each)[2], (*each)[3]};
    if (field.name != "field" && !field.name.starts_with("---")) fields.push_back(field);
  }
  REQUIRE_FALSE(fields.empty());
  return fields;
}

/// Reads a message by the words of the document alone.
class DocumentReader {
 public:
  explicit DocumentReader(const Bytes& bytes) : bytes_(bytes) {}

  void read(const std::vector<Field>& fields) {
    std::uint64_t parity = 0, phase = 0;
    for (const Field& field : fields) {
      if (field.note.find("only if it changed") != std::string::npos && parity % 2 == 0) continue;
      if (field.note.find("not if the phase is end") != std::string::npos && phase == 2) continue;
      if (field.note.find("if bit 0 of flags is set") != std::string::npos) {
        if ((static_cast<int>(values["flags"].at(0)) & 1) != 0) read_own();
        continue;
      }
      if (field.note.find("if bit 1 of flags is set") != std::string::npos &&
          (static_cast<int>(values["flags"].at(0)) & 2) == 0) {
        continue;
      }
      const std::size_t first = values[field.name].size();
      read_type(field);
      const auto& read_values = values[field.name];
      if (field.name == "number" && read_values.size() > first) parity = static_cast<std::uint64_t>(read_values[first]);
      if (field.name == "phase") phase = static_cast<std::uint64_t>(read_values[first]);
    }
  }
  bool at_end() const { return at_ == bytes_.size(); }

  std::map<std::string, std::vector<double>> values;  ///< by name of the field, in the order of the message
  std::map<std::string, std::string> texts;

 private:
  void read_type(const Field& field) {
    std::smatch found;
    if (field.type == "the rest of the message") return read_bytes(field.name, bytes_.size() - at_);
    REQUIRE_MESSAGE(std::regex_search(field.type, found, std::regex(R"((?:(\d) x )?`(\w+)`)")), field.type);
    const int times = found[1].matched ? std::stoi(found[1]) : 1;
    const std::string type = found[2];
    if (field.type.find("then records") != std::string::npos) {
      const std::vector<Field> record = table_after("A record of `" + field.name + "`");
      for (std::uint64_t left = var(); left > 0; --left) read(record);
    } else {
      for (int i = 0; i < times; ++i) read_value(field.name, type);
    }
  }
  void read_value(const std::string& name, const std::string& type) {
    if (type == "text" || type == "bytes") return read_bytes(name, var());
    if (type == "offset") {
      for (int axis = 0; axis < 3; ++axis) values[name].push_back(svar());
    } else if (type == "numbers") {
      double number = 0;
      for (std::uint64_t left = var(); left > 0; --left) values[name].push_back(number += static_cast<double>(var()));
    } else if (type == "var") {
      values[name].push_back(static_cast<double>(var()));
    } else if (type == "svar") {
      values[name].push_back(svar());
    } else if (type == "f32") {
      values[name].push_back(double{std::bit_cast<float>(static_cast<std::uint32_t>(fixed(4)))});
    } else if (type == "f64") {
      values[name].push_back(std::bit_cast<double>(fixed(8)));
    } else {
      const std::map<std::string, std::size_t> sizes{{"u8", 1}, {"u16", 2}, {"u32", 4}, {"u64", 8}, {"turn", 4}};
      REQUIRE_MESSAGE(sizes.contains(type), type);
      values[name].push_back(static_cast<double>(fixed(sizes.at(type))));
    }
  }
  /// The avatar, which the document describes in a sentence.
  void read_own() {
    const std::size_t begin = document.find("`own`: "), end = document.find("\n\n", begin);
    const std::string sentence = document.substr(begin + 7, end - begin - 7);
    const std::regex part(R"((?:(\d) x )?`(var|f32|f64|bytes)`)");
    for (std::sregex_iterator each(sentence.begin(), sentence.end(), part), none; each != none; ++each) {
      const int times = (*each)[1].matched ? std::stoi((*each)[1]) : 1;
      for (int i = 0; i < times; ++i) read_value("own", (*each)[2]);
    }
  }
  void read_bytes(const std::string& name, std::uint64_t size) {
    REQUIRE(size <= bytes_.size() - at_);
    std::string text;
    for (; size > 0; --size) text += static_cast<char>(bytes_[at_++]);
    texts[name] = text;
  }
  std::uint64_t fixed(std::size_t size) {
    REQUIRE(size <= bytes_.size() - at_);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value |= static_cast<std::uint64_t>(bytes_[at_++]) << (8 * i);
    return value;
  }
  std::uint64_t var() {
    std::uint64_t value = 0;
    for (unsigned shift = 0;; shift += 7) {
      const std::uint64_t byte = fixed(1);
      value |= (byte & 127) << shift;
      if (byte < 128) return value;
    }
  }
  double svar() {
    const std::uint64_t value = var();
    return value % 2 == 0 ? static_cast<double>(value >> 1) : -static_cast<double>(value >> 1) - 1;
  }

  const Bytes& bytes_;
  std::size_t at_ = 0;
};

template <class Message>
DocumentReader read_as(const std::string& heading, const Message& message, Bytes& bytes) {
  bytes.clear();
  write(message, bytes);
  DocumentReader reader(bytes);
  reader.read(table_after(heading));
  CHECK_MESSAGE(reader.at_end(), heading);
  const std::string number = heading.substr(heading.rfind('(') + 1);
  CHECK(reader.values.at("type").at(0) == std::stoi(number));
  return reader;
}

using Values = std::vector<double>;

}  // namespace

TEST_CASE("the document's tables read the messages of clients") {
  Bytes bytes;
  CHECK(read_as("### hello (1)", Hello{"a token"}, bytes).texts.at("token") == "a token");
  const Bytes body{std::byte{'a'}, std::byte{'b'}};
  const DocumentReader input = read_as("### input (2)", Input{7, 300, 65535, body}, bytes);
  CHECK(input.values.at("ack") == Values{7});
  CHECK(input.values.at("sequence") == Values{300});
  CHECK(input.values.at("time") == Values{65535});
  CHECK(input.texts.at("body") == "ab");
  CHECK(read_as("### ack (3)", Ack{1'000'000}, bytes).values.at("ack") == Values{1'000'000});
  CHECK(read_as("### get_shape (4)", GetShape{ShapeId(5)}, bytes).values.at("shape") == Values{5});
  CHECK(read_as("### application (5)", Application{body}, bytes).texts.at("body") == "ab");
  const DocumentReader view = read_as("### view (6)", View{{1, -2, 3}, 40}, bytes);
  CHECK(view.values.at("centre") == Values{1, -2, 3});
  CHECK(view.values.at("radius") == Values{40});
  CHECK(read_as("### describe (7)", Describe{4'000'000'000}, bytes).values.at("number") == Values{4e9});
  const DocumentReader command = read_as("### command (8)", Command{Command::Kind::kill, 12}, bytes);
  CHECK(command.values.at("command") == Values{2});
  CHECK(command.values.at("value") == Values{12});
}

TEST_CASE("the document's tables read welcome and update") {
  Bytes bytes;
  const Bytes state{std::byte{'s'}};
  const DocumentReader welcome = read_as(
      "### welcome (1)",
      Welcome{Role::operate, UserId(6), 77, 13, 20, 25, {-1, -2, -3}, {1, 2, 3}, "world", "walk", state, "t"}, bytes);
  CHECK(welcome.values.at("role") == Values{2});
  CHECK(welcome.values.at("user") == Values{7});
  CHECK(welcome.values.at("avatar") == Values{77});
  CHECK(welcome.values.at("bounds") == Values{-1, -2, -3, 1, 2, 3});
  CHECK(welcome.texts.at("world") == "world");
  CHECK(welcome.texts.at("model") == "walk");
  CHECK(welcome.texts.at("token") == "t");

  Update update;
  update.frame = 1000, update.since = 3, update.time_us = 5'000'000, update.sequence = 8, update.age = 2;
  update.echo = 77, update.hold_ms = 12;
  update.own = OwnState{9, ShapeId(6), {{1.5, -2, 3}, {0, 0, 0.5f, 0.25f}}, state};
  update.origin = {512, -1024, 5};
  update.entered = {{4, 2, ShapeId(3), Category::fixed, UserId(1), {513, -1020, 5}, 0x80000001u, state},
                    {900, 1, ShapeId(4), Category::avatar, no_user, {512, -1024, 6}, 7, {}}};
  update.moved = {{6, true, 99, {0, 0, 0}}, {10, false, 0, {600, 0, 0}}};
  update.removed = {3, 300};
  update.contacts = {{5, Phase::persist, 20, {-127, 0, 127}, 64, {512, 0, 5}},
                     {8, Phase::end, 1, {}, 0, {}},
                     {9, Phase::begin, 0, {1, 2, 3}, 1, {512, -1024, 5}}};
  update.touching = {{5, 9}, {5, 200}, {70, 71}};
  const DocumentReader found = read_as("### update (2)", update, bytes);
  const auto value = [&](const char* name) { return found.values.at(name); };
  CHECK(value("frame") == Values{1000});
  CHECK(value("since") == Values{3});
  CHECK(value("time") == Values{5'000'000});
  CHECK(value("sequence") == Values{8});
  CHECK(value("echo") == Values{77});
  CHECK(value("hold") == Values{12});
  CHECK(value("own") == Values{9, 6, 1.5, -2, 3, 0, 0, 0.5, 0.25});
  CHECK(value("origin") == Values{512, -1024, 5});
  // Of entered, then moved (doubled, plus 1 with an orientation), then contacts: differences.
  CHECK(value("number") == Values{4, 896, 13, 8, 5, 3, 1});
  CHECK(value("generation") == Values{2, 1});
  CHECK(value("shape") == Values{3, 4});
  CHECK(value("category") == Values{3, 0});
  CHECK(value("user") == Values{2, 0});
  CHECK(value("position") == Values{1, 4, 0, 0, 0, 1, -512, 1024, -5, 88, 1024, -5});
  CHECK(value("orientation") == Values{double{0x80000001u}, 7, 99});
  CHECK(value("removed") == Values{3, 300});
  CHECK(value("phase") == Values{1, 2, 0});
  CHECK(value("age") == Values{2, 20, 1, 0});
  CHECK(value("normal") == Values{129, 0, 127, 1, 2, 3});
  CHECK(value("depth") == Values{64, 1});
  CHECK(value("point") == Values{0, 1024, 0, 0, 0, 0});
  CHECK(value("a") == Values{5, 0, 65});
  CHECK(value("b") == Values{4, 195, 1});
}

TEST_CASE("the document lists every type of message and every close code, and no others") {
  const auto numbers_in = [](const std::string& text, const char* pattern) {
    std::vector<int> numbers;
    const std::regex each_number(pattern);
    for (std::sregex_iterator each(text.begin(), text.end(), each_number), none; each != none; ++each) {
      numbers.push_back(std::stoi((*each)[1]));
    }
    return numbers;
  };
  const std::size_t server = document.find("## From the gateway"), codes = document.find("## Close codes");
  const std::string end = document.substr(codes, document.find("\n## ", codes + 1) - codes);
  const char* const heading = R"(### \w+ \((\d+)\))";
  CHECK(numbers_in(document.substr(0, server), heading) == std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8});
  CHECK(numbers_in(document.substr(server, codes - server), heading) == std::vector<int>{1, 2, 3, 4, 5, 6, 7});
  std::vector<int> expected;
  for (const CloseCode code : close_codes) expected.push_back(static_cast<int>(code));
  std::ranges::sort(expected);
  CHECK(numbers_in(end, R"(\n\| (\d{4}) \|)") == expected);
}

}  // namespace ringfence::gateway
