// A real `kill -9` of `berth up`, again and again, while the plant runs on in another process.
#include <SQLiteCpp/Database.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <chrono>
#include <string>
#include <vector>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "../paths.hpp"
#include "berth/plant/world.hpp"
#include "berth/store/database.hpp"
#include "berth/store/schema.hpp"

namespace berth {
namespace {

using namespace std::chrono_literals;

constexpr unsigned slots = 10;
constexpr unsigned kills = 12;

// A `berth` of its own process; its streams go to files. Killed with its object, and with this process.
class Process {
 public:
  Process(std::vector<std::string> words, const std::string& out) {
    words.insert(words.begin(), berth::test::binary());
    pid_ = ::fork();
    if (pid_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int fd = ::open(out.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    ::dup2(fd, 1);
    ::dup2(fd, 2);
    std::vector<char*> arguments;
    for (auto& w : words) arguments.push_back(w.data());
    arguments.push_back(nullptr);
    ::execv(words.front().c_str(), arguments.data());
    ::_exit(127);
  }
  ~Process() {
    if (pid_ > 0) end(SIGKILL);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  // Its exit status, 128 + signal when it was killed.
  int end(int signal) {
    ::kill(pid_, signal);
    return wait();
  }
  int wait() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  // Waits for `there`, at most `limit`; true when it ended by itself meanwhile.
  template <class There>
  bool ended_or(There there, std::chrono::milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (std::chrono::steady_clock::now() < end && !there()) {
      siginfo_t info{};
      if (::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid != 0) {
        return true;
      }
      ::usleep(2'000);  // between two looks
    }
    return false;
  }
  bool ended_within(std::chrono::milliseconds limit) {
    return ended_or([] { return false; }, limit);
  }

 private:
  pid_t pid_ = -1;
};

std::string contents(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::size_t count(const std::string& text, std::string_view what) {
  std::size_t found = 0;
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++found;
  return found;
}

class RealKill : public ::testing::Test {
 protected:
  RealKill() {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-kill-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) std::abort();
    folder_ = pattern;
    std::ofstream machine(file("machine.toml"));
    machine << "[machine]\nname = \"killed\"\n\n[bus.field]\nport = \"plant:" << file("plant.sock")
            << "\"\nbitrate = 500_000\n\n[timing]\nheartbeat_period = \"300 ms\"\nheartbeat_timeout = \"2 s\"\n"
            << "probe_period = \"500 ms\"\nrand_response = \"8 ms\"\nlisten = \"50 ms\"\n";
    std::ofstream plant(file("plant.toml"));
    plant << "[plant]\nseed = 3\n\n[bus.field]\nbitrate = 500_000\n";
    for (unsigned i = 1; i <= slots; ++i) {
      machine << "\n[[slot]]\nbus = \"field\"\nid = " << i << "\nname = \"s" << i
              << "\"\ntype = { vendor = 1, product = " << 1 + i % 3 << " }\n";
      plant << "\n[[device]]\nbus = \"field\"\nname = \"d" << i << "\"\ntype = { vendor = 1, product = " << 1 + i % 3
            << " }\nserial = " << 100 + i << "\nresponse = { min = \"300 us\", max = \"2 ms\" }\n"
            << "store = \"60 ms\"\nreset = \"30 ms\"\n";
      // One comes with a node-ID stored, and not its own.
      if (i == 8) plant << "node_id = " << i - 2 << "\n";
    }
  }
  ~RealKill() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  [[nodiscard]] std::string file(const std::string& name) const { return folder_ + "/" + name; }

  [[nodiscard]] std::vector<std::string> up(bool json = false) const {
    std::vector<std::string> words{"up",        file("machine.toml"), "--store",   file("berth.db"),
                                   "--control", file("control.sock"), "--timeout", "110 s",
                                   "--until",   "operational"};
    if (json) words.emplace_back("--json");
    return words;
  }
  std::unique_ptr<store::Database> open_store() {
    auto opened = store::Database::open(file("berth.db"));
    EXPECT_TRUE(opened) << opened.error().message;
    return opened ? std::move(*opened) : nullptr;
  }
  // What the store holds after a kill; counts intentions that were left.
  void look_at_store() {
    const auto store = open_store();
    if (!store) return;
    const auto records = store->load("killed");
    ASSERT_TRUE(records);
    std::set<Identity> devices;
    for (const auto& r : *records) {
      if (r.intended && r.intended != r.confirmed) ++left_asked_;
      const bool alone = !r.device() || devices.insert(*r.device()).second;
      EXPECT_TRUE(alone) << "one device in two slots";
    }
    const auto blanks = store->unfinished_blanks();
    ASSERT_TRUE(blanks);
    left_asked_ += static_cast<unsigned>(blanks->size());
  }

  std::string folder_;
  unsigned left_asked_ = 0;
};

// Every device remembers the node-ID that the store says it has, and no other.
void compare(const std::string& plant_path, const std::string& state, const std::vector<places::SlotRecord>& records) {
  const auto file = plant::load_plant(plant_path);
  ASSERT_TRUE(file.plant);
  Findings findings;
  const auto world = plant::World::make(*file.plant, {}, findings);
  ASSERT_TRUE(world);
  ASSERT_TRUE(world->restore(state));
  world->start();
  world->sim().run_for(1s);
  ASSERT_EQ(records.size(), slots);
  EXPECT_TRUE(world->duplicates().empty());
  for (const auto& r : records) {
    ASSERT_TRUE(r.confirmed) << r.name.name;
    EXPECT_FALSE(r.intended) << r.name.name;
    unsigned found = 0;
    for (const auto& t : world->truth()) {
      if (t.address != r.confirmed->device) continue;
      ++found;
      EXPECT_EQ(t.persistent, r.confirmed->id) << t.name;
      EXPECT_EQ(t.active, r.confirmed->id) << t.name;
    }
    EXPECT_EQ(found, 1U) << r.name.name;
  }
}

// S1.53: killed at any instant, the next start reconciles store, bus and device memory and finishes.
TEST_F(RealKill, S1_53_BerthUpKilledWhileThePlantRunsOn) {
  Process plant({"plant", file("plant.toml"), "--listen", file("plant.sock"), "--plant-state", file("plant.state")},
                file("plant.log"));
  const auto listens = [&] { return contents(file("plant.log")).find("Ctrl-C") != std::string::npos; };
  ASSERT_FALSE(plant.ended_or(listens, 120s)) << contents(file("plant.log"));
  ASSERT_TRUE(listens());

  Random random(20);
  unsigned early = 0;
  for (unsigned k = 0; k < kills; ++k) {
    const std::string log = file("up" + std::to_string(k) + ".log");
    Process berth(up(), log);
    // A third of them anywhere, the others from the life's first binding on.
    const bool anywhere = k % 3 == 0;
    const char* const begun = random.below(2) == 0 ? ": binding: " : ": bound to ";
    if (!anywhere) berth.ended_or([&] { return count(contents(log), begun) >= 1; }, 100s);
    // At what instant it is killed is the subject: this wait is a time, drawn at random.
    if (berth.ended_within(std::chrono::milliseconds(random.below(anywhere ? 1000 : 130)))) ++early;
    const int status = berth.end(SIGKILL);
    ASSERT_TRUE(status == 128 + SIGKILL || status == 0) << status << contents(log);
    look_at_store();
    if (HasFatalFailure()) return;
  }
  Process last(up(true), file("last.json"));
  EXPECT_EQ(last.wait(), 0) << contents(file("last.json"));
  const auto report = nlohmann::json::parse(contents(file("last.json")), nullptr, false);
  ASSERT_FALSE(report.is_discarded()) << contents(file("last.json"));
  ASSERT_EQ(report["slots"].size(), slots);
  for (const auto& s : report["slots"]) EXPECT_EQ(s["state"], "operational") << s;
  EXPECT_EQ(plant.end(SIGTERM), 0) << contents(file("plant.log"));

  const auto store = open_store();
  ASSERT_TRUE(store);
  const auto records = store->load("killed");
  ASSERT_TRUE(records);
  const auto blanks = store->unfinished_blanks();
  EXPECT_TRUE(blanks && blanks->empty());
  compare(file("plant.toml"), contents(file("plant.state")), *records);
  std::printf("%u kills, %u of them in the middle of a binding, %u after the end\n", kills, left_asked_, early);
  EXPECT_LT(early, kills);
  EXPECT_GT(left_asked_, 0U) << "no kill came in the middle of a binding";
}

// Bringing up an old store with a long history takes its time; a signal ends it there, and the store is what it was.
TEST_F(RealKill, ASignalEndsALongStoreCall) {
  constexpr int lines = 1'500'000;
  const auto number = [](SQLite::Database& db, const char* what) { return db.execAndGet(what).getInt(); };
  {
    SQLite::Database raw(file("berth.db"), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    raw.exec("PRAGMA synchronous = OFF");
    store::create_schema(raw, 1);
    raw.exec("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT " + std::to_string(lines) +
             ") INSERT INTO history (stamp_ms, event, vendor, product, revision, serial, node_id, reason) "
             "SELECT i, 'e', 1, 2, 3, i, 255, '' FROM n");
    ASSERT_EQ(number(raw, "PRAGMA user_version"), 1);
  }
  Process berth({"up", file("machine.toml"), "--sim", file("plant.toml"), "--store", file("berth.db"), "--fast",
                 "--until", "operational"},
                file("up.out"));
  const bool ended = berth.ended_or([&] { return !contents(file("berth.db.lock")).empty(); }, 60s);
  ASSERT_FALSE(ended) << contents(file("up.out"));
  EXPECT_NE(berth.end(SIGTERM), 0) << contents(file("up.out"));
  SQLite::Database raw(file("berth.db"), SQLite::OPEN_READWRITE);
  EXPECT_EQ(number(raw, "PRAGMA user_version"), 1) << "it was brought up to its end: " << contents(file("up.out"));
  EXPECT_EQ(number(raw, "SELECT count(*) FROM history"), lines);
}

}  // namespace
}  // namespace berth
