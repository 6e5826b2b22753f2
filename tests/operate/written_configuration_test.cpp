// DCFs that a configuration tool writes to Berth's 1F20h and 1F22h become the configurations of slots (paper 5 §2).
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "berth/eds/concise_dcf.hpp"
#include "berth/operate/configuration_fit.hpp"
#include "berth/operate/configuration_intake.hpp"
#include "berth/operate/dcf_stream.hpp"
#include "berth/operate/written_files.hpp"
#include "tests/harness/rig.hpp"
#include "tests/operate/stranger.hpp"

using namespace berth;
using namespace berth::harness;
using operate::WrittenFiles;
using places::SlotState;

namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint16_t store_dcf = 0x1F20;
constexpr std::uint16_t concise_dcf = 0x1F22;
constexpr ObjectRef pressure_limit{0x2000, 1};
const Bytes conf{'c', 'o', 'n', 'f'};

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

std::string read_file(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// pump.dcf with another upper pressure limit, whose value there is 500.
std::string pump_dcf(unsigned limit) {
  std::string text = read_file(example_eds("pump.dcf"));
  const std::string was = "ParameterValue=500";
  text.replace(text.find(was), was.size(), "ParameterValue=" + std::to_string(limit));
  return text;
}

Bytes concise(const std::vector<eds::ConciseEntry>& entries) { return eds::encode(eds::ConciseDcf{entries}); }
eds::ConciseEntry limit_entry(std::uint8_t low, std::uint8_t high) { return {pressure_limit, {low, high}}; }

class WrittenConfigurations : public testing::Test {
 protected:
  WrittenConfigurations() : folder_(fs::temp_directory_path() / ("berth-written-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directory(folder_);
    machine_.buses[0].commands.verbs = {"configure", "nmt"};
    for (unsigned id = 1; id <= 2; ++id) {
      add_slot(machine_, id, type_pump);
      machine_.slots.back().eds_path = example_eds("pump.eds");
      add_device(plant_, "pump " + std::to_string(id), type_pump, 10 + id);
    }
    machine_.slots[1].spec.config = example_eds("pump.dcf");
  }
  ~WrittenConfigurations() override {
    stranger_.reset();
    rig_.reset();
    fs::remove_all(folder_);
  }

  void begin() {
    if (!rig_) rig_ = std::make_unique<Rig>(machine_, plant_);
    rig_->keep_written({.folder = folder_ / "kept", .machine_file = (folder_ / "machine.toml").string()});
    rig_->settle(links_);
    rig_->begin();
    ASSERT_TRUE(rig_->until_operational(60s)) << rig_->log();
    stranger_ = std::make_unique<Stranger>(*rig_);
  }
  plant::SimDevice& device(unsigned slot) {
    const auto seats = rig_->seats();
    const auto serial = std::ranges::find(seats, slot, &std::pair<unsigned, std::uint32_t>::first)->second;
    return rig_->device("pump " + std::to_string(serial - 10));
  }
  unsigned limit_of(unsigned slot) { return device(slot).device().values().get_or<std::uint16_t>(pressure_limit, 0); }
  std::uint32_t date(std::uint16_t index, std::uint8_t slot) {
    return stranger_->read<std::uint32_t>(index, slot).value_or(77);
  }
  // The slot's device is switched off and on.
  void boot(unsigned slot) {
    device(slot).power(false);
    ASSERT_TRUE(rig_->run_until([&] { return rig_->state(slot) == SlotState::absent; }, 20s)) << rig_->log();
    device(slot).power(true);
    ASSERT_TRUE(rig_->until_operational(60s)) << rig_->log();
  }
  [[nodiscard]] bool told(const std::string& text) const { return rig_->log().find(text) != std::string::npos; }
  std::vector<std::string> kept() {
    std::vector<std::string> names;
    std::error_code none;
    for (const auto& each : fs::directory_iterator(folder_ / "kept", none))
      names.push_back(each.path().filename().string());
    std::ranges::sort(names);
    return names;
  }

  fs::path folder_;
  design::Machine machine_ = one_bus(250'000);
  plant::PlantFile plant_ = one_bus_plant(3);
  manager::SlotSettings links_;
  std::unique_ptr<Rig> rig_;
  std::unique_ptr<Stranger> stranger_;
};

}  // namespace

// S5.17, S5.23: the configuration manager takes it, says which date it expects, and downloads it at the next boot-up.
TEST_F(WrittenConfigurations, S5_17_S5_23_ADcfIsDownloadedAtTheNextBootUp) {
  begin();
  const std::string dcf = pump_dcf(640);
  EXPECT_EQ(stranger_->read<std::uint8_t>(0x5F04, 1), 0) << "nothing is wanted";
  ASSERT_EQ(stranger_->write(store_dcf, 1, bytes_of(dcf), co::SdoMode::segmented), 0U) << rig_->log();
  EXPECT_EQ(stranger_->text(store_dcf, 1), dcf) << "as it is";
  EXPECT_NE(stranger_->text(concise_dcf, 1), "nothing");
  EXPECT_EQ(stranger_->read<std::uint8_t>(0x5F04, 1), 1) << "not yet";
  EXPECT_EQ(date(0x1F26, 1), 0U);
  EXPECT_EQ(date(0x1F27, 1), 0U);
  rig_->run_for(2s);
  EXPECT_EQ(limit_of(1), 100U) << "a device that runs is left alone";
  boot(1);
  EXPECT_EQ(limit_of(1), 640U);
  EXPECT_EQ(stranger_->read<std::uint8_t>(0x5F04, 1), 3);
  auto& values = device(1).device().values();
  EXPECT_NE(date(0x1F27, 1), 0U);
  EXPECT_EQ(date(0x1F26, 1), values.get_or<std::uint32_t>({0x1020, 1}, 0));
  EXPECT_EQ(date(0x1F27, 1), values.get_or<std::uint32_t>({0x1020, 2}, 0));
  EXPECT_EQ(limit_of(2), 500U) << "of another slot";
}

// By 1F25h at once, instead of what the machine file names. A date that the DCF gives itself is expected at once.
TEST_F(WrittenConfigurations, S5_17_ADcfInBlocksIsDownloadedByRequestConfiguration) {
  begin();
  std::string dcf = pump_dcf(333);
  for (const auto& [section, value] : {std::pair("[1020sub1]\n", "15000"), std::pair("[1020sub2]\n", "3600000")})
    dcf.insert(dcf.find(section) + std::string(section).size(), std::string("ParameterValue=") + value + "\n");
  ASSERT_EQ(stranger_->write(store_dcf, 2, bytes_of(dcf), co::SdoMode::block), 0U) << rig_->log();
  EXPECT_EQ(date(0x1F26, 2), 15'000U);
  EXPECT_EQ(date(0x1F27, 2), 3'600'000U);
  ASSERT_EQ(stranger_->write(0x1F82, 2, {127}), 0U);
  ASSERT_TRUE(rig_->run_until([&] { return device(2).device().state() == NmtState::pre_operational; }, 2s));
  rig_->run_for(2s);
  ASSERT_EQ(stranger_->write(0x1F25, 2, conf), 0U);
  EXPECT_TRUE(rig_->run_until([&] { return limit_of(2) == 333; }, 10s)) << rig_->log();
  EXPECT_TRUE(told("instead of \"" + example_eds("pump.dcf"))) << rig_->log();
}

// What is kept counts for the next process; an event has the line for the machine file, from whose folder it is named.
TEST_F(WrittenConfigurations, ItIsKeptOverARestart) {
  begin();
  const std::string dcf = pump_dcf(640);
  ASSERT_EQ(stranger_->write(store_dcf, 1, bytes_of(dcf), co::SdoMode::block), 0U);
  const std::string name = "rig.backbone.s1.dcf";
  ASSERT_EQ(kept(), std::vector<std::string>{name});
  EXPECT_EQ(read_file(folder_ / "kept" / name), dcf);
  EXPECT_TRUE(told("give the [[slot]] \"s1\" config = \"kept/" + name + "\"")) << rig_->log();
  stranger_.reset();
  rig_->kill();
  begin();
  EXPECT_TRUE(told("the DCF that was given while Berth ran applies; it is kept in ")) << rig_->log();
  EXPECT_EQ(stranger_->text(store_dcf, 1), dcf);
  EXPECT_EQ(stranger_->read<std::uint8_t>(0x5F04, 1), 1) << "not yet, still";
  boot(1);
  EXPECT_EQ(limit_of(1), 640U) << rig_->log();
  EXPECT_EQ(limit_of(2), 500U);
}

TEST_F(WrittenConfigurations, AnEmptyOneTakesItAway) {
  begin();
  const std::string file = read_file(example_eds("pump.dcf"));
  ASSERT_EQ(stranger_->write(store_dcf, 2, bytes_of(pump_dcf(640))), 0U);
  EXPECT_EQ(stranger_->write(concise_dcf, 2, {}), 0U) << "none was written";
  EXPECT_NE(stranger_->text(store_dcf, 2), file) << "what was written counts still";
  EXPECT_EQ(stranger_->write(store_dcf, 2, {}), 0U);
  EXPECT_EQ(stranger_->text(store_dcf, 2), file) << "config = of the machine file counts";
  EXPECT_TRUE(kept().empty());
  ASSERT_EQ(stranger_->write(concise_dcf, 1, concise({limit_entry(0x80, 0x02)})), 0U) << rig_->log();
  EXPECT_EQ(stranger_->write(concise_dcf, 1, {0, 0, 0, 0}), 0U) << "no entries";
  EXPECT_EQ(stranger_->text(concise_dcf, 1), "nothing");
  boot(2);
  EXPECT_EQ(limit_of(2), 500U);
}

TEST_F(WrittenConfigurations, S5_17_AConciseDcfCountsInsteadOfADcf) {
  begin();
  ASSERT_EQ(stranger_->write(store_dcf, 1, bytes_of(pump_dcf(640))), 0U);
  const Bytes stream = concise({limit_entry(0xBC, 0x02), {{0x1010, 1}, {'s', 'a', 'v', 'e'}}});
  ASSERT_EQ(stranger_->write(concise_dcf, 1, stream), 0U) << rig_->log();
  EXPECT_EQ(kept(), std::vector<std::string>{"rig.backbone.s1.cdcf"}) << "one of a slot";
  EXPECT_EQ(stranger_->text(store_dcf, 1), "nothing") << "it is no DCF";
  const auto back = bytes_of(stranger_->text(concise_dcf, 1));
  EXPECT_EQ(back, concise({limit_entry(0xBC, 0x02)})) << "what a configuration manager writes, commands left out";
  stranger_.reset();
  rig_->kill();
  begin();
  boot(1);
  EXPECT_EQ(limit_of(1), 700U) << rig_->log();
}

// Bad input changes nothing, and an event says what is wrong, where and what to do.
TEST_F(WrittenConfigurations, WhatDoesNotFitIsRefused) {
  begin();
  const std::string before = stranger_->text(store_dcf, 2);
  const auto refused = [&](std::uint16_t index, const Bytes& bytes, const std::string& why) {
    const auto code = stranger_->write(index, 2, bytes);
    EXPECT_TRUE(told(why)) << why << "\n" << rig_->log();
    return code;
  };
  EXPECT_EQ(refused(store_dcf, {1, 2, 3, 4}, "wrote to 1F20h:02 is refused, and nothing has changed: 1F20h:"),
            0x0609'0030U);
  EXPECT_EQ(refused(store_dcf, bytes_of(read_file(example_eds("booster.dcf"))), "it is for devices of type"),
            0x0604'0043U);
  EXPECT_EQ(refused(concise_dcf, bytes_of(pump_dcf(640)), "this is not a concise DCF"), 0x0609'0030U);
  EXPECT_EQ(refused(concise_dcf, concise({{{0x5432, 1}, {1}}}), "5432h:01"), 0x0604'0043U) << "no such object";
  EXPECT_EQ(refused(concise_dcf, concise({{pressure_limit, {1, 2, 3}}}), "2000h:01"), 0x0604'0043U) << "its length";
  EXPECT_EQ(refused(concise_dcf, concise({{{0x1000, 0}, {1, 0, 0, 0}}}), "1000h:00 cannot be written"), 0x0601'0002U);
  EXPECT_EQ(refused(concise_dcf, concise({{{0x1018, 2}, {0x31, 0, 0, 0}}, limit_entry(1, 0)}), "00000031"),
            0x0604'0043U);
  EXPECT_EQ(stranger_->text(store_dcf, 2), before);
  EXPECT_TRUE(kept().empty());
  EXPECT_EQ(stranger_->write(store_dcf, 3, bytes_of(pump_dcf(640))), 0x0609'0030U) << "no slot";
  const Bytes long_one(operate::DcfStream::longest + 1, ' ');
  EXPECT_EQ(stranger_->write(store_dcf, 2, long_one), 0x0607'0012U) << "at once";
  boot(2);
  EXPECT_EQ(limit_of(2), 500U) << rig_->log();
}

TEST_F(WrittenConfigurations, OnlyWhereTheMachineFileListsConfigure) {
  machine_.buses[0].commands.verbs = {"nmt", "upload", "sdo write"};
  begin();
  EXPECT_EQ(stranger_->write(store_dcf, 1, bytes_of(pump_dcf(640))), 0x0800'0021U);
  EXPECT_EQ(stranger_->write(concise_dcf, 1, concise({limit_entry(1, 0)})), 0x0800'0021U);
  EXPECT_EQ(stranger_->write(concise_dcf, 2, {}), 0x0800'0021U);
  EXPECT_EQ(stranger_->text(concise_dcf, 1), "nothing");
  const auto history = rig_->store().history(std::nullopt);
  ASSERT_TRUE(history);
  EXPECT_TRUE(std::ranges::none_of(*history, [](const auto& h) { return h.event == "commanded by a node"; }));
}

TEST_F(WrittenConfigurations, NoneWhileTheDeviceIsConfigured) {
  begin();
  device(2).power(false);
  ASSERT_TRUE(rig_->run_until([&] { return rig_->state(2) == SlotState::absent; }, 20s));
  ASSERT_EQ(device(2).device().state(), NmtState::initialising);
  auto& sits = device(2);
  ASSERT_EQ(stranger_->write(store_dcf, 2, bytes_of(pump_dcf(640))), 0U);
  sits.power(true);
  ASSERT_TRUE(rig_->run_until([&] { return rig_->state(2) == SlotState::configuring; }, 20s)) << rig_->log();
  EXPECT_EQ(stranger_->write(store_dcf, 2, bytes_of(pump_dcf(641))), 0x0800'0022U);
  ASSERT_TRUE(rig_->until_operational(60s)) << rig_->log();
  EXPECT_EQ(limit_of(2), 640U);
}

// A link's objects and the heartbeat are the machine file's, whatever is written: it is said which.
TEST_F(WrittenConfigurations, WhatBerthSetsItselfStays) {
  manager::Configuration linked;
  linked.file = "link";
  manager::Setting limit;
  limit.object = pressure_limit;
  limit.type = od::DataType::unsigned16;
  limit.value = od::Literal::number(222);
  linked.settings.push_back(limit);
  links_["s1"] = std::make_shared<const manager::Configuration>(linked);
  begin();
  ASSERT_EQ(limit_of(1), 222U) << rig_->log();
  std::string dcf = pump_dcf(640);
  const std::string heartbeat = "[1017]\n";
  dcf.insert(dcf.find(heartbeat) + heartbeat.size(), "ParameterValue=77\n");
  ASSERT_EQ(stranger_->write(store_dcf, 1, bytes_of(dcf)), 0U) << rig_->log();
  EXPECT_TRUE(told("Berth keeps what the machine file says of 1017h (heartbeat_period), 2000h:01;")) << rig_->log();
  boot(1);
  auto& values = device(1).device().values();
  EXPECT_EQ(limit_of(1), 222U);
  EXPECT_EQ(values.get_or<std::uint16_t>({0x2000, 2}, 0), 20) << "what the link does not need is the DCF's";
  EXPECT_NE(values.get_or<std::uint16_t>({0x1017, 0}, 0), 77);
}

TEST_F(WrittenConfigurations, WhereItCannotBeKeptItIsRefused) {
  std::ofstream(folder_ / "kept") << "a file where the folder should be";
  begin();
  EXPECT_EQ(stranger_->write(store_dcf, 1, bytes_of(pump_dcf(640))), 0x0800'0020U);
  EXPECT_TRUE(told((folder_ / "kept").string())) << rig_->log();
  EXPECT_EQ(stranger_->text(store_dcf, 1), "nothing");
  EXPECT_EQ(stranger_->read<std::uint8_t>(0x5F04, 1), 0);
}

// Without a slot table in a file there is no place for it.
TEST_F(WrittenConfigurations, WithoutAFolderItCountsUntilBerthEnds) {
  rig_ = std::make_unique<Rig>(machine_, plant_);
  rig_->begin();
  ASSERT_TRUE(rig_->until_operational(60s)) << rig_->log();
  stranger_ = std::make_unique<Stranger>(*rig_);
  ASSERT_EQ(stranger_->write(store_dcf, 1, bytes_of(pump_dcf(640))), 0U);
  EXPECT_TRUE(told("it applies until Berth ends")) << rig_->log();
  EXPECT_EQ(stranger_->text(store_dcf, 1), pump_dcf(640));
  boot(1);
  EXPECT_EQ(limit_of(1), 640U);
  ASSERT_EQ(stranger_->write(store_dcf, 1, {}), 0U);
  EXPECT_EQ(stranger_->text(store_dcf, 1), "nothing");
}

// The machine file names the kept file itself: then it is the machine file's, and nobody takes it away by SDO.
TEST_F(WrittenConfigurations, WhatTheMachineFileNamesStays) {
  begin();
  ASSERT_EQ(stranger_->write(store_dcf, 1, bytes_of(pump_dcf(640))), 0U);
  stranger_.reset();
  rig_.reset();
  machine_.slots[0].spec.config = (folder_ / "kept" / "rig.backbone.s1.dcf").string();
  begin();
  EXPECT_FALSE(told("that was given while Berth ran")) << rig_->log();
  EXPECT_EQ(stranger_->write(store_dcf, 1, {}), 0x0800'0021U);
  EXPECT_TRUE(told("leave it out there first")) << rig_->log();
  EXPECT_EQ(kept().size(), 1U);
  EXPECT_EQ(limit_of(1), 640U);
}

// The machine file may be another one than when it was written.
TEST_F(WrittenConfigurations, AKeptOneOfAnotherTypeIsNotBroughtIn) {
  const WrittenFiles files({.folder = folder_ / "kept"});
  ASSERT_TRUE(files.keep(machine_.slots[0].spec.name, WrittenFiles::Form::dcf,
                         bytes_of(read_file(example_eds("booster.dcf")))));
  rig_ = std::make_unique<Rig>(machine_, plant_);
  rig_->keep_written({.folder = folder_ / "kept"});
  rig_->begin();
  ASSERT_TRUE(rig_->run_until([&] { return rig_->state(1) == SlotState::failed; }, 60s)) << rig_->log();
  EXPECT_TRUE(told("it is for devices of type")) << rig_->log();
}

TEST(WrittenConfiguration, MustBeOfTheSlotsDeviceTypeAndRevision) {
  places::SlotSpec slot;
  slot.type = type_pump;
  slot.device_type = 0x0002'0192;
  manager::Configuration file;
  EXPECT_EQ(operate::not_for(slot, file), "") << "it says nothing";
  file.type = type_pump;
  file.device_type = slot.device_type;
  EXPECT_EQ(operate::not_for(slot, file), "");
  file.device_type = 0x0002'0191;
  EXPECT_NE(operate::not_for(slot, file).find("00020191h"), std::string::npos);
  file.device_type = 0;
  file.revision = 0x0001'0002;
  EXPECT_EQ(operate::not_for(slot, file), "") << "any revision";
  slot.rule = places::RevisionRule::exact;
  slot.revision = 0x0001'0001;
  EXPECT_NE(operate::not_for(slot, file).find("00010002h"), std::string::npos);
  slot.revision = file.revision;
  EXPECT_EQ(operate::not_for(slot, file), "");
}

// ---- the stream and the files, by themselves ------------------------------------------------------------------------

namespace {

class Kept : public operate::DcfStream::Owner {
 public:
  Bytes dcf(ObjectRef ref) override { return ref.sub == 1 ? Bytes{1, 2, 3} : Bytes{}; }
  od::AbortCode may_store(ObjectRef ref) override {
    return ref.sub == 9 ? od::AbortCode::invalid_value : od::AbortCode::none;
  }
  od::AbortCode store(ObjectRef, std::span<const std::uint8_t> bytes) override {
    stored.emplace_back(bytes.begin(), bytes.end());
    return od::AbortCode::none;
  }
  std::vector<Bytes> stored;
};

}  // namespace

TEST(DcfStream, OneTransferAtATime) {
  Kept kept;
  operate::DcfStream stream(kept);
  od::StreamUse first;
  od::StreamUse second;
  ASSERT_EQ(first.open_write(stream, {store_dcf, 1}, std::nullopt), od::AbortCode::none);
  EXPECT_EQ(second.open_write(stream, {concise_dcf, 2}, std::nullopt), od::AbortCode::device_state);
  const Bytes some{5, 6};
  EXPECT_EQ(first.write(some), od::AbortCode::none);
  EXPECT_EQ(first.close(true), od::AbortCode::none);
  EXPECT_EQ(kept.stored, std::vector<Bytes>{some});
  ASSERT_EQ(second.open_write(stream, {concise_dcf, 2}, 2), od::AbortCode::none);
  EXPECT_EQ(second.write(some), od::AbortCode::none);
  second.drop();
  EXPECT_EQ(kept.stored.size(), 1U) << "it was broken off";
  EXPECT_EQ(second.open_write(stream, {store_dcf, 9}, 2), od::AbortCode::invalid_value);
  EXPECT_TRUE(second.open_read(stream, {store_dcf, 1}).has_value());
  EXPECT_EQ(second.close(true), od::AbortCode::none);
  EXPECT_EQ(kept.stored.size(), 1U) << "it was read";
  EXPECT_EQ(second.open_read(stream, {store_dcf, 2}).error(), od::AbortCode::no_data);
}

TEST(DcfStream, IsBounded) {
  Kept kept;
  operate::DcfStream stream(kept);
  od::StreamUse use;
  EXPECT_EQ(use.open_write(stream, {store_dcf, 1}, operate::DcfStream::longest + 1), od::AbortCode::length_too_high);
  ASSERT_EQ(use.open_write(stream, {store_dcf, 1}, std::nullopt), od::AbortCode::none) << "it does not say";
  const Bytes most(operate::DcfStream::longest, 'x');
  EXPECT_EQ(use.write(most), od::AbortCode::none);
  EXPECT_EQ(use.write(Bytes{1}), od::AbortCode::length_too_high);
  use.drop();
  EXPECT_TRUE(kept.stored.empty());
}

TEST(WrittenFiles, OneFileASlotWhateverItsName) {
  const fs::path folder = fs::temp_directory_path() / ("berth-files-" + std::to_string(::getpid()));
  fs::remove_all(folder);
  const WrittenFiles files({.folder = folder});
  const Bytes bytes{1, 0, 0, 0};
  const std::string longest(400, 'n');
  std::vector<places::SlotName> names{{"m", "b", ".."},         {"m", "b.c", "d"},   {"m.b", "c", "d"},
                                      {"m", "b", "c.d"},        {"m", "b", "größe"}, {"m", "b", longest + "1"},
                                      {"m", "b", longest + "2"}};
  std::vector<std::string> paths;
  for (const auto& name : names) {
    EXPECT_EQ(files.of(name), "");
    const auto path = files.keep(name, WrittenFiles::Form::concise, bytes);
    ASSERT_TRUE(path) << describe(path.error());
    EXPECT_EQ(files.of(name), *path);
    EXPECT_EQ(fs::path(*path).parent_path(), folder);
    EXPECT_EQ(fs::status(*path).permissions() & (fs::perms::group_write | fs::perms::others_all), fs::perms::none);
    paths.push_back(*path);
  }
  std::ranges::sort(paths);
  EXPECT_EQ(std::ranges::adjacent_find(paths), paths.end()) << "each slot has its own";
  // The form that was written last counts, and a crash may have left the other.
  const auto dcf = files.keep(names[0], WrittenFiles::Form::dcf, bytes);
  ASSERT_TRUE(dcf);
  EXPECT_EQ(files.of(names[0]), *dcf);
  const fs::path left = fs::path(*dcf).replace_extension(".cdcf");
  EXPECT_FALSE(fs::exists(left));
  fs::copy_file(*dcf, left);
  fs::last_write_time(left, fs::last_write_time(*dcf) - 1s);
  EXPECT_EQ(files.of(names[0]), *dcf);
  fs::last_write_time(left, fs::last_write_time(*dcf) + 1s);
  EXPECT_EQ(files.of(names[0]), left.string());
  // Of a dry run.
  const WrittenFiles looks({.folder = folder, .writes = false});
  EXPECT_EQ(looks.keep(names[1], WrittenFiles::Form::dcf, bytes).value_or("?"), "");
  EXPECT_TRUE(looks.drop(names[0]));
  EXPECT_EQ(files.of(names[0]), left.string());
  EXPECT_TRUE(files.drop(names[0]));
  EXPECT_EQ(files.of(names[0]), "");
  fs::remove_all(folder);
}
