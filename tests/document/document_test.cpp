// A machine as HTML pages and DBC files. tests/peers/test_dbc.py has canmatrix read the latter.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "berth/can/frame.hpp"
#include "berth/document/bus_signals.hpp"
#include "berth/document/dbc.hpp"
#include "berth/document/html.hpp"
#include "berth/document/machine_document.hpp"
#include "berth/document/signals_json.hpp"
#include "tests/paths.hpp"

namespace berth::document::document_tests {
namespace {

std::string text_of(const std::vector<DocumentFile>& files, const std::string& name) {
  const auto it = std::ranges::find(files, name, &DocumentFile::name);
  EXPECT_NE(it, files.end()) << name;
  return it == files.end() ? std::string() : it->bytes;
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

design::Machine machine_of(const std::string& text) {
  auto read = design::read_machine(text, test::source_dir() + "/examples/machine.toml", design::eds_loader());
  EXPECT_TRUE(read.machine) << (read.findings.empty() ? "" : to_string(read.findings.front()));
  return std::move(*read.machine);
}

constexpr const char* one_bus = R"(
[machine]
name = "a <b> & \"c\""
[bus.field]
port = "sim"
bitrate = 125_000
)";

}  // namespace

TEST(Document, NamesAreTextAndNoHtml) {
  const auto machine = machine_of(std::string(one_bus) + R"(
[[slot]]
bus = "field"
id = 5
name = "<script>alert(1)<"
eds = "eds/io.eds"
)");
  for (const auto& file : document_of(machine, nullptr, "test")) {
    if (!file.name.ends_with(".html")) continue;
    EXPECT_FALSE(has(file.bytes, "<script")) << file.name;
    EXPECT_FALSE(has(file.bytes, "http:")) << file.name << ": nothing from elsewhere";
    EXPECT_TRUE(has(file.bytes, "default-src 'none'")) << file.name;
  }
  const auto files = document_of(machine, nullptr, "test");
  EXPECT_TRUE(has(text_of(files, "index.html"), "a &lt;b&gt; &amp; &quot;c&quot;"));
  EXPECT_TRUE(has(text_of(files, "slot-1-5.html"), "&lt;script&gt;alert(1)&lt;"));
}

// The PDO and its mapping are those of examples/eds/io.eds: inputs in TPDO 1, by the predefined connection set 185h.
TEST(Document, SignalsAreToldToPagesWithTheirPlaces) {
  const auto machine = machine_of(std::string(one_bus) + R"(
[[slot]]
bus = "field"
id = 5
name = "io"
eds = "eds/io.eds"
)");
  const auto json = nlohmann::json::parse(signals_json(machine, nullptr));
  ASSERT_EQ(json["buses"].size(), 1U);
  EXPECT_EQ(json["buses"][0]["bus"], "field");
  const auto& messages = json["buses"][0]["messages"];
  const auto of = [&](unsigned id) {
    const auto it = std::ranges::find_if(messages, [&](const auto& m) { return m["id"] == id && m["ext"] == false; });
    EXPECT_NE(it, messages.end()) << id;
    return it == messages.end() ? nlohmann::json() : *it;
  };
  const auto tpdo = of(0x185);
  EXPECT_EQ(tpdo["name"], "TPDO 1");
  EXPECT_EQ(tpdo["sender"], "io");
  const auto signals = tpdo["signals"];  // 1A00h: 60000108h, 60000208h
  ASSERT_EQ(signals.size(), 2U);
  for (unsigned i = 0; i < 2; ++i) {
    EXPECT_EQ(signals[i]["at"], 8 * i);
    EXPECT_EQ(signals[i]["bits"], 8);
    EXPECT_EQ(signals[i]["object"], i == 0 ? "6000h:01" : "6000h:02");
    EXPECT_EQ(signals[i]["type"], "unsigned");
  }
  const auto state = of(0x705)["signals"][0];
  EXPECT_EQ(state["bits"], 7);
  EXPECT_FALSE(state.contains("object"));
  EXPECT_EQ(state["values"][0]["name"], "boot-up");
  for (const auto& each : messages) EXPECT_FALSE(each["signals"].empty());
}

// Every link of every page leads to a file that is there.
TEST(Document, NoLinkLeadsNowhere) {
  for (const std::string name : {"conveyor/machine.toml", "harvester/machine.toml", "linked.toml", "belt.toml",
                                 "hundred-twenty.toml", "five-slaves.toml"}) {
    SCOPED_TRACE(name);
    auto loaded = design::load_machine(test::source_dir() + "/examples/" + name);
    ASSERT_TRUE(loaded.machine);
    traffic::LinkPlan links;
    const bool linked = !loaded.machine->links.empty();
    if (linked) links = traffic::plan_links(*loaded.machine);
    ASSERT_FALSE(has_errors(links.findings));
    const auto files = document_of(*loaded.machine, linked ? &links : nullptr, "test");
    unsigned followed = 0;
    for (const auto& file : files) {
      for (auto at = file.bytes.find("href=\""); at != std::string::npos; at = file.bytes.find("href=\"", at + 1)) {
        const auto begin = at + 6;
        const std::string to = file.bytes.substr(begin, file.bytes.find('"', begin) - begin);
        EXPECT_EQ(std::ranges::count(files, to, &DocumentFile::name), 1) << file.name << " -> " << to;
        ++followed;
      }
    }
    EXPECT_GT(followed, loaded.machine->slots.size());
  }
}

TEST(Document, ALinkHasItsDeadlineItsBoundAndItsPdo) {
  auto loaded = design::load_machine(test::source_dir() + "/examples/linked.toml");
  ASSERT_TRUE(loaded.machine);
  const auto links = traffic::plan_links(*loaded.machine);
  ASSERT_FALSE(has_errors(links.findings));
  const auto files = document_of(*loaded.machine, &links, "test");
  const std::string index = text_of(files, "index.html");
  EXPECT_TRUE(has(index, "press/speed")) << index;
  EXPECT_TRUE(has(index, "belt/press_speed"));
  EXPECT_TRUE(has(index, "TPDO 1 of press, 181h")) << index;
  const std::string bus = text_of(files, "bus-1.html");
  EXPECT_TRUE(has(bus, "UNSIGNED16")) << "a network variable has its type";
  EXPECT_TRUE(has(bus, "<td>speed</td>")) << "and its name";
  const std::string dbc = text_of(files, "field.dbc");
  EXPECT_TRUE(has(dbc, " SG_ speed : 0|16@1+ (1,0) [0|0] \"\" belt\n")) << dbc;
}

// DBC: names of letters, digits and "_", 32 at most, none twice; quotes are none; Windows-1252.
TEST(Document, DbcHasNamesThatItsReadersTake) {
  BusSignals bus{.bus = "b", .bit_rate = 250'000, .senders = {"left drive", "left-drive", "2nd", "master"}};
  Message pdo{
      .key = 0x185, .name = "TPDO 1", .sender = "left-drive", .bytes = 8, .period = std::chrono::milliseconds(20)};
  const std::string lengthy = "A name that is longer than the thirty-two characters that DBC has room for";
  pdo.signals = {
      {.name = lengthy,
       .object = {0x6064, 0},
       .at = 0,
       .bits = 32,
       .type = od::DataType::integer32,
       .meaning = {.unit = "°C", .number = 1, .exponent = -1, .values = {{0xFFFF'FFFF'FFFF'FFFF, "say \"no\""}}},
       .receivers = {"2nd", "left drive"}},
      {.name = lengthy, .object = {0x6065, 0}, .at = 32, .bits = 32, .type = od::DataType::real32}};
  bus.messages = {pdo, {.key = 0x1234567 | can::extended_flag, .name = "far", .sender = "", .bytes = 0}};
  const std::string text = dbc_of(bus);
  EXPECT_TRUE(has(text, "\nBU_: left_drive left_drive_2 _2nd master\n")) << text;
  EXPECT_TRUE(has(text, "\nBO_ 389 left_drive_TPDO_1: 8 left_drive_2\n")) << text;
  EXPECT_TRUE(has(text,
                  "\n SG_ A_name_that_is_longer_than_the_t : 0|32@1- (0.1,0) [0|0] \"\xB0"
                  "C\" _2nd,left_drive\n"))
      << text;
  EXPECT_TRUE(has(text, "\n SG_ A_name_that_is_longer_than_the_2 : 32|32@1+ (1,0) [0|0] \"\" Vector__XXX\n") ||
              has(text, "\n SG_ A_name_that_is_longer_than_th_2 : 32|32@1+ (1,0) [0|0] \"\" Vector__XXX\n"))
      << text;
  EXPECT_TRUE(has(text, "\nBO_ 2166572391 far: 0 Vector__XXX\n")) << text;
  EXPECT_TRUE(has(text, "VAL_ 389 A_name_that_is_longer_than_the_t -1 \"say 'no'\" ;\n")) << text;
  EXPECT_TRUE(has(text, "SIG_VALTYPE_ 389 A_name")) << text;
  EXPECT_TRUE(has(text, "BA_ \"GenMsgCycleTime\" BO_ 389 20;\n")) << text;
  EXPECT_TRUE(has(text, "CM_ SG_ 389 A_name_that_is_longer_than_the_t \"6064h:00 " + lengthy + "\";\n")) << text;
}

}  // namespace berth::document::document_tests
