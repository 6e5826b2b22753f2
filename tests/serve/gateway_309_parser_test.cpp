// Lines of CiA 309-3: what each command means, what is wrong with a line, and the text of values. Expected values by
// hand from the command table of docs/gateway.md.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include <cmath>
#include <limits>

#include "berth/base/base64.hpp"
#include "berth/serve/cia309.hpp"

namespace berth::serve {
namespace {

using od::DataType;
using Bytes = std::vector<std::uint8_t>;

cia309::Request good(std::string_view line) {
  const auto parsed = cia309::parse_line(line);
  EXPECT_FALSE(parsed.error) << line << ": " << static_cast<int>(*parsed.error);
  return parsed.request;
}
unsigned error_of(std::string_view line) {
  const auto parsed = cia309::parse_line(line);
  return parsed.error ? static_cast<unsigned>(*parsed.error) : 0;
}
cia309::Request with(cia309::Verb verb, std::initializer_list<std::uint32_t> numbers = {}) {
  cia309::Request r;
  r.sequence = 1;
  r.verb = verb;
  for (const auto n : numbers) r.numbers[r.count++] = n;
  return r;
}

TEST(Gateway309Line, BlankLinesAndCommentsAskForNothing) {
  for (const auto* const line : {"", " ", "\t\r", "# [1] start", "   # x"}) {
    EXPECT_EQ(good(line).verb, cia309::Verb::nothing) << line;
  }
}

TEST(Gateway309Line, SequenceNumbers) {
  EXPECT_EQ(good("[0] help").sequence, 0U);
  EXPECT_EQ(good("[4294967295] help").sequence, 4294967295U);
  EXPECT_EQ(good("[0x10]help").sequence, 16U);
  EXPECT_EQ(good("  [ 010 ]\thelp\r").sequence, 8U);
  for (const auto* const line : {"help", "[1 help", "1] help", "[] help", "[-1] help", "[4294967296] help", "[x] help",
                                 "[1", "[", "[[1]] help", "[$NODEID] help", "[+1] help"}) {
    EXPECT_EQ(error_of(line), 101U) << line;
    EXPECT_EQ(cia309::parse_line(line).request.sequence, 0U) << line;
  }
  EXPECT_EQ(cia309::parse_line("[77] nonsense").request.sequence, 77U);
}

TEST(Gateway309Line, NetAndNode) {
  const auto node = good("[1] 5 start");
  EXPECT_EQ(node.node, 5);
  EXPECT_FALSE(node.net);
  const auto both = good("[1] 65535 0x7F start");
  EXPECT_EQ(both.net, 65535);
  EXPECT_EQ(both.node, 127);
  EXPECT_EQ(good("[1] 3 0 start").node, 0);
  const auto net = good("[1] 2 lss_store");  // one number before a command of a net is the net
  EXPECT_EQ(net.net, 2);
  EXPECT_FALSE(net.node);
  EXPECT_FALSE(good("[1] start").node);
  EXPECT_EQ(error_of("[1] 128 start"), 107U);
  EXPECT_EQ(error_of("[1] 0 5 start"), 106U);
  EXPECT_EQ(error_of("[1] 0 lss_store"), 106U);
  EXPECT_EQ(error_of("[1] 1 2 lss_store"), 101U);
  EXPECT_EQ(error_of("[1] 1 2 3 start"), 101U);
  EXPECT_EQ(error_of("[1] 65536 1 start"), 101U);
  EXPECT_EQ(error_of("[1] 5"), 101U);
  EXPECT_EQ(error_of("[1]"), 101U);
}

TEST(Gateway309Line, Sdo) {
  auto r = with(cia309::Verb::read);
  r.node = 4;
  r.index = 0x1017;
  r.type = {DataType::unsigned16, cia309::Type::Shown::plain};
  EXPECT_EQ(good("[1] 4 read 0x1017 0 u16"), r);
  EXPECT_EQ(good("[1] 4 R 4119 00 U16 # comment"), r);
  r.type = {};
  EXPECT_EQ(good("[1] 4 r 0x1017 0"), r);
  r.verb = cia309::Verb::write;
  r.sub = 255;
  r.type = {DataType::integer16, cia309::Type::Shown::plain};
  r.data = {0xFE, 0xFF};
  EXPECT_EQ(good("[1] 4 WRITE 0x1017 0xff i16 -2"), r);
  for (const auto* const line :
       {"[1] 4 r", "[1] 4 r 0x1017", "[1] 4 r 65536 0", "[1] 4 r 0x1017 256", "[1] 4 r 0x1017 0 u9",
        "[1] 4 r 0x1017 0 u8 1", "[1] 4 w 0x1017 0 u8", "[1] 4 w 0x1017 0 u8 256", "[1] 4 w 0x1017 0 u8 -1",
        "[1] 4 w 0x1017 0 i8 128", "[1] 4 w 0x1017 0 i8 -129", "[1] 4 w 0x1017 0 b 2", "[1] 4 w 0x1017 0 u8 1 2",
        "[1] 4 w 0x1017 0 u8 $NODEID", "[1] 4 w 0x1017 0 \"u8\" 1", "[1] 4 r -1 0", "[1] 4 w 0x1017 0 u8 0x",
        "[1] 4 r \"0x1017\" 0"}) {
    EXPECT_EQ(error_of(line), 101U) << line;
  }
}

TEST(Gateway309Line, NmtAndErrorControl) {
  const std::pair<const char*, cia309::Verb> words[] = {
      {"start", cia309::Verb::start},
      {"STOP", cia309::Verb::stop},
      {"preop", cia309::Verb::preop},
      {"preoperational", cia309::Verb::preop},
      {"reset node", cia309::Verb::reset_node},
      {"reset comm", cia309::Verb::reset_comm},
      {"reset communication", cia309::Verb::reset_comm},
      {"disable guarding", cia309::Verb::disable_guarding},
      {"disable heartbeat", cia309::Verb::disable_heartbeat},
  };
  for (const auto& [text, verb] : words) EXPECT_EQ(good(std::string("[1] ") + text), with(verb)) << text;
  EXPECT_EQ(good("[1] enable guarding 1000 3"), with(cia309::Verb::enable_guarding, {1000, 3}));
  EXPECT_EQ(good("[1] enable heartbeat 1500"), with(cia309::Verb::enable_heartbeat, {1500}));
  for (const auto* const line :
       {"[1] reset", "[1] reset nodes", "[1] preope", "[1] enable", "[1] start 5", "[1] enable guarding 1000",
        "[1] enable guarding 0 3", "[1] enable heartbeat 0", "[1] enable heartbeat 65536", "[1] disable guarding 1"}) {
    EXPECT_NE(error_of(line), 0U) << line;
  }
  EXPECT_EQ(error_of("[1] preope"), 100U);
}

TEST(Gateway309Line, Settings) {
  EXPECT_EQ(good("[1] set network 2"), with(cia309::Verb::set_network, {2}));
  EXPECT_EQ(good("[1] set node 127"), with(cia309::Verb::set_node, {127}));
  EXPECT_EQ(good("[1] set node 0"), with(cia309::Verb::set_node, {0}));
  EXPECT_EQ(good("[1] set sdo_timeout 65535"), with(cia309::Verb::set_sdo_timeout, {65535}));
  EXPECT_EQ(good("[1] set sdo_block 1"), with(cia309::Verb::set_sdo_block, {1}));
  EXPECT_EQ(good("[1] set heartbeat 0"), with(cia309::Verb::set_heartbeat, {0}));
  EXPECT_EQ(good("[1] set id 255"), with(cia309::Verb::set_id, {255}));
  EXPECT_EQ(good("[1] set command_timeout 4294967295"), with(cia309::Verb::set_command_timeout, {4294967295U}));
  EXPECT_EQ(good("[1] set command_size 65536"), with(cia309::Verb::set_command_size, {65536}));
  EXPECT_EQ(good("[1] init 9"), with(cia309::Verb::init, {9}));
  EXPECT_EQ(good("[1] boot_up_indication Disable"), with(cia309::Verb::boot_up_indication, {0}));
  EXPECT_EQ(good("[1] boot_up_indication enable"), with(cia309::Verb::boot_up_indication, {1}));
  EXPECT_EQ(good("[1] _sync_indication Enable"), with(cia309::Verb::sync_indication, {1}));
  EXPECT_EQ(good("[1] info version"), with(cia309::Verb::info_version));
  EXPECT_EQ(error_of("[1] set colour 1"), 100U);
  for (const auto* const line :
       {"[1] set", "[1] set network 0", "[1] set network 65536", "[1] set node 128", "[1] set sdo_timeout 0",
        "[1] set sdo_block 2", "[1] set id 128", "[1] set id 0", "[1] init 10", "[1] init", "[1] info", "[1] info vers",
        "[1] boot_up_indication", "[1] boot_up_indication 1", "[1] set node", "[1] set node 1 1"}) {
    EXPECT_EQ(error_of(line), 101U) << line;
  }
}

TEST(Gateway309Line, Pdos) {
  auto r = with(cia309::Verb::set_rpdo);
  r.pdo = {.number = 512, .cob_id = 0x40000181, .transmission = 0xFF};
  r.pdo.fields = {{DataType::unsigned8, 0, 0}, {DataType::integer16, 0x6000, 1}};
  EXPECT_EQ(good("[1] set rpdo 512 0x40000181 event 2 u8 0x6000 1 i16"), r);
  r.verb = cia309::Verb::set_tpdo;
  r.pdo = {.number = 1, .cob_id = 0x201, .transmission = 240};
  EXPECT_EQ(good("[1] set tpdo 1 0x201 SYNC240 0"), r);
  r.pdo.transmission = 0xFD;
  EXPECT_EQ(good("[1] set tpdo 1 0x201 rtr 0"), r);
  r.pdo = {.number = 1, .cob_id = 0x201, .transmission = 0xFF, .inhibit = 100, .event_timer = 500};
  EXPECT_EQ(good("[1] set tpdox 1 0x201 event 100 500 0"), r);
  r.pdo = {.number = 1, .cob_id = 0x201, .transmission = 0xFD, .event_timer = 500};
  EXPECT_EQ(good("[1] set tpdox 1 0x201 rtr 500 0"), r);
  r.pdo = {.number = 1, .cob_id = 0x201, .transmission = 5, .sync_start = 7};
  EXPECT_EQ(good("[1] set tpdox 1 0x201 sync5 7 0"), r);
  EXPECT_EQ(good("[1] read pdo 3"), with(cia309::Verb::read_pdo, {3}));
  auto w = with(cia309::Verb::write_pdo, {3});
  w.values = {1, 0xFFFF'FFFF'FFFF'FFFF, 0x1122334455667788};
  EXPECT_EQ(good("[1] w p 3 3 1 -1 0x1122334455667788"), w);
  for (const auto* const line :
       {"[1] set rpdo 0 0x181 event 0", "[1] set rpdo 513 0x181 event 0", "[1] set rpdo 1 0x181 sync241 0",
        "[1] set rpdo 1 0x181 sync 0", "[1] set rpdo 1 0x181 event", "[1] set rpdo 1 0x181 event 1",
        "[1] set rpdo 1 0x181 event 1 vs", "[1] set rpdo 1 0x181 event 1 hex", "[1] set rpdo 1 0x181 event 0 u8",
        "[1] set rpdo 1 0x181 event 65", "[1] set rpdo 1 0x181 event 1 0x6000 u8", "[1] r p", "[1] r p 0", "[1] w p 3",
        "[1] w p 3 2 1", "[1] w p 3 1 1 1", "[1] w p 3 1 x", "[1] set tpdo 1 0x201 event 100 500 0"}) {
    EXPECT_EQ(error_of(line), 101U) << line;
  }
}

TEST(Gateway309Line, Lss) {
  EXPECT_EQ(good("[1] lss_switch_glob 1"), with(cia309::Verb::lss_switch_global, {1}));
  EXPECT_EQ(good("[1] lss_switch_sel 1 2 3 0xFFFFFFFF"),
            with(cia309::Verb::lss_switch_selective, {1, 2, 3, 0xFFFFFFFF}));
  EXPECT_EQ(good("[1] lss_set_node 255"), with(cia309::Verb::lss_set_node, {255}));
  EXPECT_EQ(good("[1] lss_conf_bitrate 0 4"), with(cia309::Verb::lss_conf_bitrate, {0, 4}));
  // CANopenNode's words of 20 letters lost this one (PR 627).
  EXPECT_EQ(good("[1] lss_activate_bitrate 1000"), with(cia309::Verb::lss_activate_bitrate, {1000}));
  EXPECT_EQ(good("[1] lss_store"), with(cia309::Verb::lss_store));
  EXPECT_EQ(good("[1] lss_inquire_addr"), with(cia309::Verb::lss_inquire_address));
  EXPECT_EQ(good("[1] lss_inquire_addr 3"), with(cia309::Verb::lss_inquire_address, {3}));
  EXPECT_EQ(good("[1] lss_inquire_addr 0x5B"), with(cia309::Verb::lss_inquire_address, {1}));
  EXPECT_EQ(good("[1] lss_get_node"), with(cia309::Verb::lss_get_node));
  EXPECT_EQ(good("[1] lss_identity 1 2 3 4 5 6"), with(cia309::Verb::lss_identity, {1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(good("[1] lss_ident_nonconf"), with(cia309::Verb::lss_identify_non_configured));
  EXPECT_EQ(good("[1] _lss_slowscan 1 2 3 4 5 6"), with(cia309::Verb::lss_slowscan, {1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(good("[1] _lss_fastscan"), with(cia309::Verb::lss_fastscan));
  EXPECT_EQ(good("[1] _lss_fastscan 50"), with(cia309::Verb::lss_fastscan, {50}));
  EXPECT_EQ(good("[1] _lss_fastscan 1 2 3 4 5 6 7 8"), with(cia309::Verb::lss_fastscan, {0, 1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(good("[1] lss_allnodes"), with(cia309::Verb::lss_allnodes));
  EXPECT_EQ(good("[1] lss_allnodes 100 2 1"), with(cia309::Verb::lss_allnodes, {100, 2, 1}));
  EXPECT_EQ(good("[1] lss_allnodes 100 2 1 2 0x11 0 0 2 7 0 9"),
            with(cia309::Verb::lss_allnodes, {100, 2, 1, 0x11, 0xFFFFFFFF, 0, 0, 7, 0xFFFFFFFF, 0, 0}));
  EXPECT_EQ(error_of("[1] lss_allnodes 100 2 1 1 0 0 0 0 0 0 0"), 100U);  // ignoring a part
  EXPECT_EQ(error_of("[1] lss_dance"), 100U);
  for (const auto* const line :
       {"[1] lss_switch_glob 2", "[1] lss_switch_sel 1 2 3", "[1] lss_switch_sel 1 2 3 4 5", "[1] lss_set_node 0",
        "[1] lss_set_node 200", "[1] lss_conf_bitrate 0", "[1] lss_conf_bitrate 0 10", "[1] lss_activate_bitrate 65536",
        "[1] lss_inquire_addr 4", "[1] lss_inquire_addr 0x59", "[1] lss_inquire_addr 0x5E", "[1] lss_identity 1 2 3",
        "[1] _lss_fastscan 1 2", "[1] lss_allnodes 100 2", "[1] lss_allnodes 100 128 1", "[1] lss_store 1"}) {
    EXPECT_EQ(error_of(line), 101U) << line;
  }
}

TEST(Gateway309Line, QuotesAndStrayBytes) {
  EXPECT_EQ(good(R"([1] 4 w 0x2000 0 vs "a # ""b""")").data, (Bytes{'a', ' ', '#', ' ', '"', 'b', '"'}));
  EXPECT_EQ(good(R"([1] 4 w 0x2000 0 vs plain#comment)").data, (Bytes{'p', 'l', 'a', 'i', 'n'}));
  EXPECT_EQ(good(R"([1] 4 w 0x2000 0 vs "")").data, Bytes{});
  EXPECT_EQ(good(R"([1] 4 w 0x2000 0 vs "C:\temp\\x\x0A")").data,
            (Bytes{'C', ':', '\\', 't', 'e', 'm', 'p', '\\', 'x', '\n'}));
  for (const std::string line : {R"([1] 4 w 0x2000 0 vs "a)", R"([1] 4 w 0x2000 0 vs "a"b)",
                                 R"([1] 4 w 0x2000 0 vs a"b")", R"([1] 4 w 0x2000 0 vs a b)"}) {
    EXPECT_EQ(error_of(line), 101U) << line;
  }
  EXPECT_EQ(error_of(std::string("[1] st\0art", 10)), 101U);
  EXPECT_EQ(error_of("[1] start\x01"), 101U);
  EXPECT_EQ(error_of("[1] st\xFF\xFE"), 100U);
  EXPECT_EQ(error_of("GET / HTTP/1.1"), 101U);
}

std::string shown(std::string_view type, Bytes bytes) {
  return cia309::value_text(*cia309::type_named(type), bytes).value_or("(none)");
}
Bytes read(std::string_view type, std::string_view words) {
  return good("[1] 1 w 0x2000 0 " + std::string(type) + " " + std::string(words)).data;
}

TEST(Gateway309Value, EachTypeByHand) {
  EXPECT_EQ(shown("b", {1}), "1");
  EXPECT_EQ(shown("i8", {0x80}), "-128");
  EXPECT_EQ(shown("i24", {0xFF, 0xFF, 0xFF}), "-1");
  EXPECT_EQ(shown("i64", {0, 0, 0, 0, 0, 0, 0, 0x80}), "-9223372036854775808");
  EXPECT_EQ(shown("u8", {0xFF}), "255");
  EXPECT_EQ(shown("u40", {1, 0, 0, 0, 1}), "4294967297");
  EXPECT_EQ(shown("u64", Bytes(8, 0xFF)), "18446744073709551615");
  EXPECT_EQ(shown("x16", {0x34, 0x12}), "0x1234");
  EXPECT_EQ(shown("x8", {7}), "0x07");
  EXPECT_EQ(shown("r32", {0, 0, 0x80, 0x3F}), "1");
  EXPECT_EQ(shown("r64", {0, 0, 0, 0, 0, 0, 0xE0, 0xBF}), "-0.5");
  EXPECT_EQ(shown("t", {0x05, 0, 0, 0xF1, 0x02, 0}), "2 16777221") << "bits 28 to 31 are void (CiA 301)";
  EXPECT_EQ(shown("td", {0, 0, 0, 0, 0xFF, 0xFF}), "65535 0");
  EXPECT_EQ(shown("vs", {'a', ' ', '"', '\\', '\r', '\n'}), R"("a ""\\\x0D\x0A")");
  EXPECT_EQ(shown("vs", {}), R"("")");
  EXPECT_EQ(shown("os", {'f', 'o', 'o', 'b'}), "Zm9vYg==");
  EXPECT_EQ(shown("us", {'f', 'o'}), "Zm8=");
  EXPECT_EQ(shown("d", {'f', 'o', 'o'}), "Zm9v");
  EXPECT_EQ(shown("d", {}), R"("")");
  EXPECT_EQ(shown("hex", {0xF4, 0x01}), "F4 01");
  EXPECT_EQ(shown("u16", {1}), "(none)");
  EXPECT_EQ(shown("u8", {}), "(none)");
  EXPECT_EQ(read("r32", "3.5"), (Bytes{0, 0, 0x60, 0x40}));
  EXPECT_EQ(read("r64", "-0.5"), (Bytes{0, 0, 0, 0, 0, 0, 0xE0, 0xBF}));
  EXPECT_EQ(read("t", "2 268435455"), (Bytes{0xFF, 0xFF, 0xFF, 0x0F, 2, 0}));
  EXPECT_EQ(read("u32", "0xdeadBEEF"), (Bytes{0xEF, 0xBE, 0xAD, 0xDE}));
  EXPECT_EQ(read("hex", "F4 01 aB"), (Bytes{0xF4, 0x01, 0xAB}));
  EXPECT_EQ(read("hex", "F401aB"), (Bytes{0xF4, 0x01, 0xAB}));
  EXPECT_EQ(read("os", "Zm9vYg=="), (Bytes{'f', 'o', 'o', 'b'}));
  EXPECT_EQ(read("d", R"("")"), Bytes{});
  for (const auto* const line : {"t 1", "t 65536 0", "t 0 268435456", "r32 1,5", "r32 1e99", "os Zm9vYg=",
                                 "os Zm9v Zm9v", "os Zm9=", "os Z===", "os ====", "os Zm\x39!", "hex F", "hex 0xF4",
                                 "hex", "i64 9223372036854775808", "u64 18446744073709551616", "u24 16777216"}) {
    EXPECT_EQ(error_of("[1] 1 w 0x2000 0 " + std::string(line)), 101U) << line;
  }
}

// RFC 4648's vectors, which are RFC 2045's too.
TEST(Gateway309Value, Base64OfTheRfc) {
  const std::pair<std::string, std::string> vectors[] = {{"", ""},
                                                         {"f", "Zg=="},
                                                         {"fo", "Zm8="},
                                                         {"foo", "Zm9v"},
                                                         {"foob", "Zm9vYg=="},
                                                         {"fooba", "Zm9vYmE="},
                                                         {"foobar", "Zm9vYmFy"}};
  for (const auto& [plain, coded] : vectors) {
    const Bytes bytes(plain.begin(), plain.end());
    EXPECT_EQ(to_base64(bytes), coded);
    EXPECT_EQ(from_base64(coded), bytes);
  }
}

RC_GTEST_PROP(Gateway309Value, ReadsBackWhatItShows, ()) {
  static const std::vector<std::string> names{"b",   "i8",  "i16", "i24", "i32", "i40", "i48", "i56", "i64", "u8",
                                              "u16", "u24", "u32", "u40", "u48", "u56", "u64", "x8",  "x16", "x32",
                                              "x64", "r32", "r64", "t",   "td",  "vs",  "os",  "us",  "d",   "hex"};
  const auto name = *rc::gen::elementOf(names);
  const auto type = *cia309::type_named(name);
  const auto size = od::byte_size(type.type);
  auto bytes = *rc::gen::container<Bytes>(size != 0 ? size : *rc::gen::inRange<std::size_t>(1, 40),
                                          rc::gen::arbitrary<std::uint8_t>());
  if (type.type == DataType::boolean) bytes[0] &= 1U;
  if (od::is_time(type.type)) bytes[3] &= 0x0FU;
  if (od::is_real(type.type)) RC_PRE(!std::isnan(od::real_of(type.type, od::load(type.type, bytes.data()))));
  const auto text = cia309::value_text(type, bytes);
  RC_ASSERT(text.has_value());
  RC_ASSERT(text->find_first_of("\r\n") == std::string::npos);
  const auto line = cia309::parse_line("[1] 1 w 0x2000 0 " + name + " " + *text);
  RC_ASSERT(!line.error);
  RC_ASSERT(line.request.data == bytes);
}

RC_GTEST_PROP(Gateway309Line, AnyBytesGiveARequestOrACode, (const std::string& line)) {
  const auto parsed = cia309::parse_line(line);
  if (parsed.error) RC_ASSERT(*cia309::text_of(*parsed.error) != '\0');
  const auto again = cia309::parse_line("[9] " + line);
  if (again.error) RC_ASSERT(again.request.sequence == 9U);
}

TEST(Gateway309Reply, Lines) {
  EXPECT_EQ(cia309::ok_line(4294967295U), "[4294967295] OK\r\n");
  EXPECT_EQ(cia309::reply_line(1, "5"), "[1] 5\r\n");
  EXPECT_EQ(cia309::error_line(2, cia309::Code::syntax), "[2] ERROR:101\r\n");
  EXPECT_EQ(cia309::abort_line(3, 0x06020000), "[3] ERROR:0x06020000\r\n");
  const auto help = cia309::help_text();
  for (std::size_t at = 0; at < help.size();) {
    const auto end = help.find("\r\n", at);
    ASSERT_NE(end, std::string::npos);
    EXPECT_EQ(good(help.substr(at, end - at)).verb, cia309::Verb::nothing) << "each line is a comment";
    at = end + 2;
  }
}

}  // namespace
}  // namespace berth::serve
