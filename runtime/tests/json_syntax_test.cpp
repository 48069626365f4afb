// Texts that are no JSON, or JSON that no description can be.
#include <gtest/gtest.h>

#include <string>

#include "comma_locales.h"
#include "described_finger.h"

namespace {

std::string refusal(const std::string& text) {
  const Reading reading = read(text);
  EXPECT_EQ(reading.status, TENDONFMU_BAD_IMAGE);
  EXPECT_EQ(reading.message.find('\n'), std::string::npos);
  for (const char c : reading.message) {
    EXPECT_GE(static_cast<unsigned char>(c), 0x20u) << reading.message;
  }
  return reading.message;
}

void expect_start(const std::string& text, const std::string& start) {
  EXPECT_EQ(refusal(text).find(start), 0u) << refusal(text);
}

TEST(JsonSyntax, ErrorsNameLineAndColumn) {
  expect_start("", "JSON, line 1, column 1: ");
  expect_start("{", "JSON, line 1, column 2: ");
  expect_start("{\n  \"a\": 1,\n}", "JSON, line 3, column 1: ");
  expect_start("{\"a\": 1,\n \"b\": [1,, 2]}", "JSON, line 2, column 10: ");
  expect_start("{} {}", "JSON, line 1, column 4: ");
  expect_start("{\"a\": 01}", "JSON, line 1, column 8: ");
  EXPECT_NE(refusal("{\"a\": 1,}").find("unexpected '}'"), std::string::npos) << refusal("{\"a\": 1,}");
  expect_start("{ // a finger\n}", "JSON, line 1, column 3: ");
  expect_start("/* a finger */ {}", "JSON, line 1, column 1: ");
  expect_start(std::string("{}\0", 3), "JSON, line 1, column 3: ");
  expect_start(std::string("{\"a\0b\": 1}", 10), "JSON, line 1, column 4: ");
}

TEST(JsonSyntax, EveryBeginningOfADescriptionIsRefused) {
  const std::string text = small_finger().dump();
  for (std::size_t size = 0; size < text.size(); ++size) {
    expect_start(text.substr(0, size), "JSON, line 1, column ");
  }
}

TEST(JsonSyntax, NumbersThatAreNotFiniteAreRefused) {
  for (const char* number : {"NaN", "nan", "Infinity", "-Infinity", "inf", "1e999", "-1e999", ".5", "+1", "0x10"}) {
    expect_start("{\"a\": " + std::string(number) + "}", "JSON, line 1, column ");
  }
}

TEST(JsonSyntax, BytesThatAreNotUtf8AreRefused) {
  for (const char* bytes : {"\xff", "\xc3", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xc0\xaf"}) {
    expect_start("{\"" + std::string(bytes) + "\": 1}", "JSON, line 1, column ");
    expect_start("{\"name\": \"" + std::string(bytes) + "\"}", "JSON, line 1, column ");
  }
  expect_start(std::string("\xff\xfe{\0}\0", 6), "JSON, line 1, column 4: a zero byte");
  expect_start("{\"name\": \"\\ud800\"}", "JSON, line 1, column ");
}

TEST(JsonSyntax, KeysGivenTwiceAreRefusedByPath) {
  expect_start(R"({"name": 1, "name": 1})", "name: key given twice");
  expect_start(R"({"tendons": [{}, {"edge_friction": [null, {"static": 1, "static": 2}]}]})",
               "tendons[2].edge_friction[2].static: key given twice");
  expect_start(R"({"contact": {"threshold": [1], "a": {"b": [[1, {"c": {}, "c": 1}]]}}})",
               "contact.a.b[1][2].c: key given twice");
  expect_start(R"({"a": 1, "\u0061": 1})", "a: key given twice");
}

TEST(JsonSyntax, DeepNestingIsRefusedWhateverItsDepth) {
  for (const std::size_t depth : {33u, 1000u, 1000000u}) {
    expect_start(std::string(depth, '['), "JSON nested too deeply: expected at most 32 levels");
    std::string objects;
    for (std::size_t i = 0; i < depth; ++i) {
      objects += "{\"a\":";
    }
    expect_start(objects, "JSON nested too deeply: expected at most 32 levels");
  }
  expect_start(std::string(32, '[') + std::string(32, ']'), "description = [...]: expected an object");
}

TEST(JsonSyntax, HugeFilesAreRefusedUnread) {
  const std::string text((std::size_t{64} << 20) + 1, ' ');
  expect_start(text, "JSON of 67108865 bytes: expected at most 67108864");
}

TEST(JsonSyntax, OtherValuesThanAnObjectAreRefused) {
  expect_start("null", "description: missing; expected an object");
  expect_start("1", "description = 1: expected an object");
  expect_start("\"finger\"", "description = \"finger\": expected an object");
}

TEST(JsonSyntax, NumbersAreReadTheSameInEveryLocale) {
  const std::string text = small_finger().dump();
  const Reading expected = read(text);
  in_comma_locales([&] { EXPECT_EQ(read(text).image, expected.image); });
}

}  // namespace
