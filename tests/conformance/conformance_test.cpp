// A Berth device made from any description against a conformance tester's checks (berth/doctor/conformance.hpp), and
// the checks against devices that are wrong.
#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <string>
#include <vector>

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
  using Lie = std::function<void(can::Frame& answer)>;
  Liar(can::Port& port, Lie lie) : port_(port), lie_(std::move(lie)) {}
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
    if (frame.id == 0x585 && lie_) lie_(told);
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
  Findings findings;       ///< of the making of the device
};

std::vector<std::vector<std::uint8_t>> all_values(const od::Values& values, const od::Description& description) {
  std::vector<std::vector<std::uint8_t>> all;
  for (const auto& sub : description.subs()) {
    const auto bytes = values.stored(sub);
    all.emplace_back(bytes.begin(), bytes.end());
  }
  return all;
}

Examined examine(const fs::path& eds, bool lasting, Liar::Lie lie = {}) {
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
  Examined examined;
  const auto world = plant::World::make(file, {}, examined.findings);
  if (!world) ADD_FAILURE() << (examined.findings.empty() ? "" : to_string(examined.findings.front()));
  if (!world) return examined;
  const auto reading = eds::read_any_file(eds);
  const auto controller = world->attach_master("b");
  Liar port(*controller, std::move(lie));
  can::Dispatcher dispatcher(world->executor(), port);
  world->start();
  world->sim().run_for(1s);
  doctor::ConformanceOptions options{.node = NodeId(5), .description = reading.file.description, .lasting = lasting};
  const auto& values = world->devices().front()->device().values();
  const auto& described = values.description();
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
    const auto examined = examine(file, true);
    expect_good(examined, 80);
    EXPECT_TRUE(examined.findings.empty()) << to_string(examined.findings.front());
  }
}

TEST(Conformance, NoFailureOfADeviceMadeFromRealDescriptions) {
  if (!fs::is_directory(test::eds_folder())) {
    GTEST_SKIP() << "no folder of real device descriptions (" << test::eds_folder() << "); set BERTH_EDS_DIR";
  }
  for (const auto& file : descriptions(test::eds_folder())) {
    SCOPED_TRACE(file.filename().string());
    expect_good(examine(file, true), 40);
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

/// One object of the application, and of CiA 301's the lines that are given.
fs::path small_description(const std::string& name, const std::string& mandatory, const std::string& sections) {
  fs::path path = fs::path(::testing::TempDir()) / ("conformance-" + std::to_string(::getuid()) + "-" + name + ".eds");
  std::ofstream(path) << "[FileInfo]\nFileName=" << name
                      << ".eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n"
                         "[DeviceInfo]\nVendorName=Own\nVendorNumber=1\nProductName=Small\nProductNumber=2\n"
                         "RevisionNumber=3\nBaudRate_500=1\nGranularity=0\nLSS_Supported=1\n"
                         "[DummyUsage]\nDummy0005=1\n"
                         "[MandatoryObjects]\n"
                      << mandatory << sections
                      << "[OptionalObjects]\nSupportedObjects=0\n"
                         "[ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n"
                         "[2000]\nParameterName=Speed\nObjectType=0x7\nDataType=0x0006\nAccessType=rw\n"
                         "DefaultValue=7\nPDOMapping=0\n";
  return path;
}

std::string mandatory_words(const Examined& examined) {
  std::string words;
  for (const auto& f : examined.findings) words += f.message.substr(0, f.message.find('.'));
  return words;
}

// Issue 12: whatever its description lacks, a device that Berth makes has what CiA 301 demands, and it is told.
TEST(Conformance, WhatADescriptionLacksTheDeviceHasAllTheSame) {
  const auto none = small_description("none", "SupportedObjects=0\n", "");
  const auto bare = examine(none, true);
  expect_good(bare, 30);
  EXPECT_EQ(mandatory_words(bare),
            "not described, and mandatory in every device (CiA 301): 1000h, 1001h, 1017h, 1018h");
  // An identity without its vendor-ID; the type is there and stays what the description says.
  const auto partly = small_description(
      "partly", "SupportedObjects=2\n1=0x1000\n2=0x1018\n",
      "[1000]\nParameterName=Device type\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x191\n"
      "PDOMapping=0\n[1018]\nParameterName=Identity\nObjectType=0x9\nSubNumber=2\n"
      "[1018sub0]\nParameterName=Count\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nDefaultValue=4\n"
      "[1018sub4]\nParameterName=Serial number\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\n");
  const auto examined = examine(partly, true);
  expect_good(examined, 30);
  EXPECT_EQ(mandatory_words(examined),
            "not described, and mandatory in every device (CiA 301): 1001h, 1017h, 1018h:01");
  fs::remove(none);
  fs::remove(partly);
}

// The report is of the device: that its description lacks the object too is no excuse.
TEST(Conformance, AMissingMandatoryObjectIsAFailure) {
  const auto file = small_description("missing", "SupportedObjects=0\n", "");
  using Indices = std::set<std::uint16_t>;
  for (const auto& [absent, object] : std::vector<std::pair<Indices, std::uint16_t>>{
           {{0x1000}, 0x1000}, {{0x1001}, 0x1001}, {{0x1018}, 0x1018}, {{0x1017, 0x100C}, 0x1017}}) {
    SCOPED_TRACE(object);
    const auto without = [&absent](can::Frame& answer) {
      const auto asked = co::sdo::multiplexer(answer);
      const bool initiates = answer.data[0] == 0x80 || (answer.data[0] & 0xE0U) == 0x40;
      if (initiates && absent.contains(asked.index)) co::sdo::put_abort(answer, asked, od::AbortCode::no_object);
    };
    expect_good(examine(file, false, without), 20, {object});
  }
  fs::remove(file);
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
