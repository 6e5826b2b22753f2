// A Berth device made from any description against a conformance tester's checks (berth/doctor/conformance.hpp), and
// the checks against devices that are wrong.
#include <filesystem>
#include <fstream>
#include <set>

#include "../eds_folder.hpp"
#include "../paths.hpp"
#include "../pch.hpp"
#include "berth/base/bytes.hpp"
#include "berth/co/sdo.hpp"
#include "berth/doctor/conformance.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/plant/world.hpp"
#include "berth/rt/scope.hpp"

namespace {

using namespace berth;
using namespace std::chrono_literals;
namespace fs = std::filesystem;
using doctor::Verdict;

/// Stands between the examiner and the bus and changes what SDO answers say.
class Liar final : public can::Port, private can::Listener {
 public:
  using Lie = void (*)(can::Frame& answer);
  Liar(can::Port& port, Lie lie) : port_(port), lie_(lie) {}
  ~Liar() { port_.listen(nullptr, {}); }
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override { return port_.send(frame, tag); }
  void withdraw(std::uint32_t tag) noexcept override { port_.withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    port_.listen(listener == nullptr ? nullptr : this, accept);
  }
  [[nodiscard]] can::Status status() const noexcept override { return port_.status(); }
  bool restart(std::uint32_t bit_rate) noexcept override { return port_.restart(bit_rate); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    can::Frame told = frame;
    if (frame.id == 0x585 && lie_ != nullptr) lie_(told);
    listener_->received(told, at);
  }
  void sent(std::uint32_t tag, rt::Time at) noexcept override { listener_->sent(tag, at); }
  void changed(const can::Status& status, rt::Time at) noexcept override { listener_->changed(status, at); }
  can::Port& port_;
  Lie lie_;
  can::Listener* listener_ = nullptr;
};

rt::Task<void> ask(can::Dispatcher& dispatcher, const doctor::ConformanceOptions& options, doctor::Conformance& report,
                   std::optional<Result<void>>& done) {
  done = co_await doctor::examine(dispatcher, options, report);
}

struct Examined {
  doctor::Conformance report;
  std::optional<Result<void>> done;
  bool untouched = false;  ///< the device's values are what they were
};

std::vector<std::vector<std::uint8_t>> all_values(const od::Values& values, const od::Description& description) {
  std::vector<std::vector<std::uint8_t>> all;
  for (const auto& sub : description.subs()) {
    const auto bytes = values.stored(sub);
    all.emplace_back(bytes.begin(), bytes.end());
  }
  return all;
}

Examined examine(const fs::path& eds, bool lasting, Liar::Lie lie = nullptr) {
  plant::PlantFile file;
  file.buses.push_back({"b", 500'000});
  plant::PlantDevice device;
  device.name = "d";
  device.bus = "b";
  device.eds = device.eds_path = eds.string();
  device.address = {1, 2, 3, 4};
  device.source = plant::NodeIdSource::hard_coded;
  device.node_id = NodeId(5);
  device.response = {200us, 500us, 0, 0ms};
  file.devices.push_back(device);
  Findings findings;
  const auto world = plant::World::make(file, {}, findings);
  for (const auto& f : findings) ADD_FAILURE() << to_string(f);
  Examined examined;
  if (!world) return examined;
  const auto reading = eds::read_any_file(eds);
  const auto controller = world->attach_master("b");
  Liar port(*controller, lie);
  can::Dispatcher dispatcher(world->executor(), port);
  world->start();
  world->sim().run_for(1s);
  doctor::ConformanceOptions options{.node = NodeId(5), .description = reading.file.description, .lasting = lasting};
  const auto& values = world->devices().front()->device().values();
  const auto& described = *reading.file.description;
  const auto before = all_values(values, described);
  rt::Scope scope(world->executor());
  scope.spawn(ask(dispatcher, options, examined.report, examined.done));
  world->sim().run_until([&] { return examined.done.has_value(); }, 30min);
  examined.untouched = all_values(values, described) == before;
  return examined;
}

/// Fails, with its object, for each mandatory object that `absent` names.
void expect_good(const Examined& examined, std::size_t least, const std::set<std::uint16_t>& absent = {}) {
  ASSERT_TRUE(examined.done) << "it did not end";
  EXPECT_TRUE(*examined.done) << describe(examined.done->error());
  std::set<std::uint16_t> failed;
  for (const auto& check : examined.report.checks) {
    if (check.verdict != Verdict::failed) continue;
    const bool of_a_service = !check.has_object && check.what.find("1018h") != std::string::npos;
    const std::uint16_t index = of_a_service ? 0x1018 : check.object.index;
    EXPECT_TRUE(absent.contains(index)) << to_string(check);
    failed.insert(index);
  }
  EXPECT_EQ(failed, absent);
  EXPECT_GE(examined.report.count(Verdict::passed), least);
}

/// What every device must have and this description has not.
std::set<std::uint16_t> mandatory_absent(const fs::path& file) {
  const auto reading = eds::read_any_file(file);
  const auto has = [&](std::uint16_t index) { return reading.file.description->find(index) != nullptr; };
  std::set<std::uint16_t> absent;
  for (const std::uint16_t index : std::array<std::uint16_t, 3>{0x1000, 0x1001, 0x1018}) {
    if (!has(index)) absent.insert(index);
  }
  if (!has(0x1017) && !(has(0x100C) && has(0x100D))) absent.insert(0x1017);
  return absent;
}

std::vector<fs::path> descriptions(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const auto kind = entry.path().extension();
    if (kind == ".eds" || kind == ".dcf" || kind == ".xdd") found.push_back(entry.path());
  }
  std::ranges::sort(found);
  return found;
}

// A conformance report of a Berth device made from any description has no failure.
TEST(Conformance, NoFailureOfADeviceMadeFromOurDescriptions) {
  const auto files = descriptions(fs::path(test::source_dir()) / "examples" / "eds");
  ASSERT_GE(files.size(), 3U);
  for (const auto& file : files) {
    SCOPED_TRACE(file.filename().string());
    expect_good(examine(file, true), 80);
  }
}

TEST(Conformance, NoFailureOfADeviceMadeFromRealDescriptions) {
  if (!fs::is_directory(test::eds_folder())) {
    GTEST_SKIP() << "no folder of real device descriptions (" << test::eds_folder() << "); set BERTH_EDS_DIR";
  }
  for (const auto& file : descriptions(test::eds_folder())) {
    SCOPED_TRACE(file.filename().string());
    expect_good(examine(file, true), 40, mandatory_absent(file));
  }
}

// `berth doctor --conformance`: nothing is changed, and still most is asked.
TEST(Conformance, TheHarmlessPartChangesNothing) {
  for (const auto& file : descriptions(fs::path(test::source_dir()) / "examples" / "eds")) {
    SCOPED_TRACE(file.filename().string());
    const auto examined = examine(file, false);
    expect_good(examined, 60);
    EXPECT_TRUE(examined.untouched);
  }
}

const fs::path drive = fs::path(test::source_dir()) / "examples" / "eds" / "drive.eds";

/// The drive's description without some objects: their sections and their places in the lists.
fs::path without(const std::vector<std::string>& indices) {
  std::ifstream whole(drive);
  fs::path path = fs::path(::testing::TempDir()) / ("without-" + indices.front() + ".eds");
  std::ofstream rest(path);
  bool dropped = false;
  const auto one_of = [&](const std::string& text, std::string_view before) {
    return std::ranges::any_of(indices, [&](const auto& index) { return text.find(std::string(before) + index) == 0; });
  };
  for (std::string line; std::getline(whole, line);) {
    if (line.starts_with('[')) dropped = one_of(line, "[");
    const auto value = line.find('=');
    const bool listed = value != std::string::npos && std::isdigit(static_cast<unsigned char>(line[0])) != 0 &&
                        one_of(line.substr(value + 1), "0x");
    if (!dropped && !listed) rest << line << '\n';
  }
  return path;
}

// The report is of the device: that its description lacks the object too is no excuse.
TEST(Conformance, AMissingMandatoryObjectIsAFailure) {
  const std::vector<std::pair<std::vector<std::string>, std::uint16_t>> lacking{
      {{"1000"}, 0x1000}, {{"1001"}, 0x1001}, {{"1018"}, 0x1018}, {{"1017", "100C"}, 0x1017}};
  for (const auto& [indices, object] : lacking) {
    SCOPED_TRACE(indices.front());
    const auto file = without(indices);
    ASSERT_EQ(mandatory_absent(file), std::set<std::uint16_t>{object});
    expect_good(examine(file, false), 40, {object});
    fs::remove(file);
  }
}

// No refusal is taken for right because it is one: with another abort code every check of a refusal fails.
TEST(Conformance, AnotherAbortCodeFailsEveryCheckOfARefusal) {
  const auto examined = examine(drive, false, [](can::Frame& answer) {
    if (answer.data[0] == 0x80) store_le<std::uint32_t>(answer.data.data() + 4, 0x0800'0021);
  });
  unsigned refusals = 0;
  for (const auto& check : examined.report.checks) {
    if (check.what.find(" is refused with ") == std::string::npos) continue;
    ++refusals;
    EXPECT_EQ(check.verdict, Verdict::failed) << to_string(check);
  }
  EXPECT_GE(refusals, 40U);
}

// A device that takes what it must refuse, as far as its answers go.
TEST(Conformance, AConfirmationFailsEveryCheckOfARefusedDownload) {
  const auto examined = examine(drive, false, [](can::Frame& answer) {
    if (answer.data[0] == 0x80 && answer.data[2] != 0)
      answer = co::sdo::make(0x585, 0x60, co::sdo::multiplexer(answer));
  });
  unsigned downloads = 0;
  for (const auto& check : examined.report.checks) {
    const bool download = check.what.starts_with("a download to") || check.what.starts_with("a restricted CAN-ID");
    if (!download) continue;
    ++downloads;
    EXPECT_EQ(check.verdict, Verdict::failed) << to_string(check);
  }
  EXPECT_GE(downloads, 20U);
}

TEST(Conformance, WrongValuesAreSeen) {
  const auto failed = [](const Examined& examined, std::string_view what) {
    return std::ranges::any_of(examined.report.checks, [&](const auto& check) {
      return check.verdict == Verdict::failed && check.what.find(what) != std::string::npos;
    });
  };
  const auto one_more = [](can::Frame& answer) {
    if (answer.data[0] == 0x4F) answer.data[0] = 0x4B;
  };
  EXPECT_TRUE(failed(examine(drive, false, one_more), "the error register is there, one byte"));
  const auto unsized = [](can::Frame& answer) {
    if (answer.data[0] == 0x43) answer.data[0] = 0x42;
  };
  EXPECT_TRUE(failed(examine(drive, false, unsized), "it says that no byte is unused"));
  const auto other_size = [](can::Frame& answer) {
    if (answer.data[0] == 0xC6 || answer.data[0] == 0xC2) answer.data[4] ^= 1U;
  };
  EXPECT_TRUE(failed(examine(drive, false, other_size), "a block upload with"));
}

TEST(Conformance, ANodeThatIsNotThereIsAnError) {
  plant::PlantFile file;
  file.buses.push_back({"b", 500'000});
  Findings findings;
  const auto world = plant::World::make(file, {}, findings);
  const auto port = world->attach_master("b");
  const auto other = world->attach_master("b");  // somebody to acknowledge
  can::Dispatcher dispatcher(world->executor(), *port);
  const doctor::ConformanceOptions options{.node = NodeId(5)};
  doctor::Conformance report;
  std::optional<Result<void>> done;
  rt::Scope scope(world->executor());
  scope.spawn(ask(dispatcher, options, report, done));
  world->sim().run_until([&] { return done.has_value(); }, 30min);
  ASSERT_TRUE(done);
  ASSERT_FALSE(*done);
  EXPECT_EQ(done->error().code, Errc::timeout);
  EXPECT_TRUE(report.checks.empty());
}

}  // namespace
