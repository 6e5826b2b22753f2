// Against a reader and writer that shares no code: tests/sparkplug/reader.py.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "edge_world.hpp"
#include "tests/paths.hpp"

namespace sparkplug_test {
namespace {

using Json = nlohmann::json;

std::string hex(const Bytes& bytes) {
  std::string out;
  for (const auto byte : bytes) {
    char text[3];
    std::snprintf(text, sizeof text, "%02x", byte);
    out += text;
  }
  return out;
}
Bytes from_hex(const std::string& text) {
  Bytes out;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    out.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
  }
  return out;
}

class Reader : public EdgeWorld {
 public:
  void SetUp() override {
    if (run("--check", "") == 0) return;
    const char* const wanted = std::getenv("BERTH_REQUIRE");  // NOLINT(concurrency-mt-unsafe)
    if (wanted != nullptr && std::string(wanted).find("mqtt") != std::string::npos) FAIL() << "no python3-protobuf";
    GTEST_SKIP() << "python3-protobuf is not installed: no other reader has looked at the payloads";
  }
  /// Its exit status; what it printed is in `lines`.
  int run(const std::string& arguments, const std::string& input) {
    const auto base = testing::TempDir() + "/sparkplug_" + std::to_string(::getpid());
    std::ofstream(base + ".in") << input;
    const auto command = "PATH=/usr/bin:$PATH python3 '" + test::source_dir() + "/tests/sparkplug/reader.py' " +
                         arguments + " <'" + base + ".in' >'" + base + ".out'";
    const int status = std::system(command.c_str());  // NOLINT(concurrency-mt-unsafe): nothing else runs here
    std::ifstream out(base + ".out");
    lines.clear();
    for (std::string line; std::getline(out, line);) lines.push_back(line);
    std::remove((base + ".in").c_str());
    std::remove((base + ".out").c_str());
    return WEXITSTATUS(status);
  }
  /// The published messages as the other reader sees them, by "TYPE device".
  std::vector<std::pair<std::string, Json>> read(std::vector<Publication> messages) {
    std::string input;
    for (const auto& each : messages) input += hex(each.bytes) + "\n";
    EXPECT_EQ(run("", input), 0);
    EXPECT_EQ(lines.size(), messages.size());
    std::vector<std::pair<std::string, Json>> out;
    for (std::size_t i = 0; i < messages.size() && i < lines.size(); ++i) {
      const auto topic = parse_topic(messages[i].topic);
      out.emplace_back(std::string(name(topic->type)) + " " + topic->device, Json::parse(lines[i]));
    }
    return out;
  }
  std::vector<std::string> lines;
};

Json metric_of(const Json& payload, const std::string& name) {
  for (const auto& each : payload.at("metrics")) {
    if (each.value("name", "") == name) return each;
  }
  return {};
}

// SP.103, SP.122, SP.94: all kinds of messages of an edge node, as another stack reads them.
TEST_F(Reader, ReadsWhatAnEdgeNodePublishes) {
  Template motor;
  motor.definition = true;
  Metric speed;
  speed.name = "speed";
  speed.type = DataType::int32;
  motor.members = {speed};
  motor.parameters = {{"poles", DataType::uint8, std::uint64_t{4}}};
  auto unit = metric("load", DataType::float32, 0.5F);
  unit.properties.properties = {{"unit", DataType::string, std::string("%")}};
  const DataSet table{.columns = {{"n", DataType::uint8}, {"x", DataType::float64}}, .rows = {{std::uint64_t{3}, 2.5}}};
  ASSERT_TRUE(node.set_metrics(
      {unit, metric("Motor", DataType::template_type, Boxed<Template>(motor)),
       metric("table", DataType::data_set, Boxed<DataSet>(table)),
       metric("list", DataType::int16_array, Boxed<Array>(std::vector<std::int64_t>{-2, 3})),
       metric("none", DataType::string, Null{}), metric("time", DataType::date_time, std::uint64_t{1'670'000'000'001})},
      now));
  device("drive", -1);
  std::vector<Publication> messages{node.connecting(now)};
  node.connected(now);
  change("", "load", 0.75F);
  change("drive", "speed", std::int64_t{-70'000}, Quality::bad);
  pass(1ms);
  node.device_died("drive", now);
  node.disconnected(now);
  device("drive", 8);
  change("drive", "speed", std::int64_t{9});
  (void)node.connecting(now);
  node.connected(now);
  pass(200ms);
  messages.insert(messages.end(), wire.published.begin(), wire.published.end());
  const auto all = read(messages);
  std::vector<std::string> kinds;
  for (const auto& [kind, json] : all) kinds.push_back(kind);
  ASSERT_EQ(kinds, (std::vector<std::string>{"NDEATH ", "NBIRTH ", "DBIRTH drive", "NDATA ", "DDATA drive",
                                             "DDEATH drive", "NBIRTH ", "DBIRTH drive", "NDATA ", "DDATA drive"}));
  EXPECT_EQ(all[0].second,
            Json::parse(R"({"timestamp":1000000,"metrics":[{"name":"bdSeq","timestamp":1000000,"datatype":4,
      "long_value":0,"which":"long_value"}]})"));
  const auto& birth = all[1].second;
  EXPECT_EQ(birth.at("seq"), 0);
  EXPECT_EQ(metric_of(birth, "Node Control/Rebirth"),
            Json::parse(R"({"name":"Node Control/Rebirth","timestamp":1000000,"datatype":11,"boolean_value":false,
                            "which":"boolean_value"})"));
  const auto load = metric_of(birth, "load");
  EXPECT_EQ(load.at("float_value"), 0.5);
  EXPECT_EQ(load.at("properties"),
            Json::parse(R"({"keys":["unit"],"values":[{"type":12,"string_value":"%","which":"string_value"}]})"));
  EXPECT_EQ(metric_of(birth, "Motor").at("template_value"),
            Json::parse(R"({"metrics":[{"name":"speed","datatype":3,"is_null":true,"which":null}],"parameters":
                            [{"name":"poles","type":5,"int_value":4,"which":"int_value"}],"is_definition":true})"));
  EXPECT_EQ(metric_of(birth, "table").at("dataset_value"),
            Json::parse(R"({"num_of_columns":2,"columns":["n","x"],"types":[5,10],"rows":[{"elements":
                            [{"int_value":3,"which":"int_value"},{"double_value":2.5,"which":"double_value"}]}]})"));
  EXPECT_EQ(metric_of(birth, "list").at("bytes_value"), "feff0300");
  EXPECT_EQ(metric_of(birth, "none").at("is_null"), true);
  EXPECT_EQ(metric_of(birth, "none").at("which"), nullptr);
  EXPECT_EQ(metric_of(birth, "time").at("long_value"), 1'670'000'000'001);
  EXPECT_EQ(metric_of(all[2].second, "speed").at("int_value"), 0xFFFF'FFFF);
  EXPECT_EQ(all[3].second.at("metrics").at(0).at("alias"), load.at("alias"));
  EXPECT_EQ(all[4].second.at("metrics"),
            Json::array({{{"alias", metric_of(all[2].second, "speed").at("alias")},
                          {"timestamp", 1'000'000},
                          {"int_value", 4'294'897'296},
                          {"properties", Json::parse(R"({"keys":["Quality"],"values":[{"type":3,"int_value":0,
                                                         "which":"int_value"}]})")},
                          {"which", "int_value"}}}));
  EXPECT_EQ(all[5].second, Json::parse(R"({"timestamp":1000001,"seq":4})"));
  EXPECT_EQ(all[9].second.at("metrics").at(1).at("is_historical"), true);
}

TEST_F(Reader, WritesWhatBerthReads) {
  ASSERT_EQ(run("--payloads", ""), 0);
  std::map<std::string, Payload> all;
  for (const auto& line : lines) {
    const auto space = line.find(' ');
    const auto payload = decode(from_hex(line.substr(space + 1)));
    ASSERT_TRUE(payload) << line;
    all[line.substr(0, space)] = *payload;
  }
  const auto& birth = all.at("birth");
  EXPECT_EQ(birth.at, Utc{1'670'000'000'000});
  EXPECT_EQ(birth.seq, 0U);
  ASSERT_EQ(birth.metrics.size(), 15U);
  std::map<std::string, Metric> by_name;
  for (const auto& each : birth.metrics) by_name[*each.name] = each;
  EXPECT_EQ(by_name.at("bdSeq").value, Value(std::int64_t{7}));
  EXPECT_EQ(by_name.at("i8").value, Value(std::int64_t{-1}));
  EXPECT_EQ(by_name.at("i16").value, Value(std::int64_t{-2}));
  EXPECT_EQ(by_name.at("u32").value, Value(std::uint64_t{4'000'000'000}));
  EXPECT_EQ(by_name.at("f").value, Value(1.5F));
  EXPECT_EQ(by_name.at("d").value, Value(-0.1));
  EXPECT_EQ(by_name.at("s").value, Value(std::string("Gr\xC3\xBC\xC3\x9F"
                                                     "e")));
  EXPECT_EQ(by_name.at("t").value, Value(std::uint64_t{1'670'000'000'001}));
  EXPECT_EQ(by_name.at("none").value, Value(Null{}));
  EXPECT_EQ(by_name.at("a").value, Value(Boxed<Array>(std::vector<std::int64_t>{-1})));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(by_name.at("odd").value));
  EXPECT_EQ(quality(by_name.at("q")), Quality::stale);
  EXPECT_EQ(
      *std::get<Boxed<DataSet>>(by_name.at("table").value),
      (DataSet{.columns = {{"n", DataType::uint8}, {"x", DataType::float64}}, .rows = {{std::uint64_t{3}, 2.5}}}));
  const auto motor = *std::get<Boxed<Template>>(by_name.at("Motor").value);
  EXPECT_TRUE(motor.definition);
  EXPECT_EQ(motor.members.at(0).name, "speed");
  EXPECT_EQ(motor.parameters.at(0).value, Value(std::uint64_t{4}));
  EXPECT_EQ(by_name.at("i8").alias, 1U);
  EXPECT_EQ(by_name.at("i8").at, Utc{2});
  const auto& data = all.at("data");
  EXPECT_EQ(data.seq, 255U);
  EXPECT_EQ(interpret(DataType::int8, data.metrics.at(0).value), Value(std::int64_t{-128}));
  EXPECT_TRUE(data.metrics.at(1).historical);
  EXPECT_TRUE(all.at("death").metrics.empty());
}

}  // namespace
}  // namespace sparkplug_test
