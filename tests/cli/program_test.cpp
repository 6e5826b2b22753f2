// Version, scenes, and the control socket's lines and paths by themselves.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "berth/command/control.hpp"
#include "berth/command/reply.hpp"
#include "command_fixture.hpp"

namespace berth::test {
namespace {

TEST(Program, VersionHelpAndScenes) {
  EXPECT_EQ(berth({"version"}).out.substr(0, 6), "berth ");
  EXPECT_TRUE(Json::parse(berth({"version", "--json"}).out).at("version").is_string());
  EXPECT_EQ(berth({"--help"}).status, 0);
  EXPECT_EQ(berth({"up", "--help"}).status, 0);
  EXPECT_EQ(berth({}).status, 2);
  EXPECT_TRUE(contains(berth({"skan"}).err, "did you mean scan?"));
}

// docs/protocols/can-frames.md §Arbitration: the seventeenth collision; a lone node stays error passive and is never
// bus-off.
TEST(Program, Scenes) {
  const Json two = Json::parse(berth({"sim", "two-with-one-id", "--json"}).out);
  bool both_passive = false;
  for (const auto& step : two.at("steps")) {
    unsigned at_128 = 0;
    for (const auto& node : step.at("nodes")) at_128 += node.at("tec") == 128 ? 1U : 0U;
    both_passive = both_passive || at_128 == 2;
  }
  EXPECT_TRUE(both_passive);
  const Json lone = Json::parse(berth({"sim", "lone-node", "--json"}).out);
  const Json& last = lone.at("steps").back().at("nodes").at(0);
  EXPECT_EQ(last.at("tec"), 128);
  EXPECT_EQ(last.at("state"), "passive");
  EXPECT_TRUE(contains(berth({"sim", "lone-node"}).out, "TEC 128"));
  // S4.1: the two roads to bus-off.
  const Json again = Json::parse(berth({"sim", "again-with-one-id", "--json"}).out);
  EXPECT_EQ(again.at("steps").back().at("nodes").at(1).at("state"), "bus-off");
  EXPECT_EQ(again.at("steps").back().at("nodes").at(1).at("tec"), 262);
  const Json rate = Json::parse(berth({"sim", "wrong-bit-rate", "--json"}).out);
  EXPECT_EQ(rate.at("steps").back().at("nodes").at(0).at("state"), "bus-off");
  EXPECT_EQ(rate.at("steps").back().at("nodes").at(2).at("state"), "active");
  EXPECT_EQ(berth({"sim", "three-nodes"}).status, 2);
}

RC_GTEST_PROP(ControlLine, RequestsComeBack, ()) {
  command::Request request;
  request.verb = "v" + *rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127));
  request.arguments = *rc::gen::container<std::map<std::string, std::string>>(
      rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127)),
      rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127)));
  const std::string line = command::to_json(request);
  RC_ASSERT(line.find('\n') == std::string::npos);
  std::string error;
  RC_ASSERT(command::parse_request(line, error) == request);
  RC_ASSERT(error.empty());
}

RC_GTEST_PROP(ControlLine, AnyBytesAreARequestOrAReason, (const std::string& bytes)) {
  std::string error;
  const auto request = command::parse_request(bytes, error);
  RC_ASSERT(request.verb.empty() == !error.empty());
  RC_ASSERT(command::parse_reply(bytes).status == 3);
}

RC_GTEST_PROP(ControlLine, RepliesComeBack, (int status, const std::vector<std::uint8_t>& bytes)) {
  command::Reply reply = command::refusal(status, "because");
  std::string text;
  for (const auto b : bytes) text += static_cast<char>(1 + b % 126);
  reply.lines = {text, ""};
  const std::string line = command::to_json(reply);
  RC_ASSERT(line.find('\n') == std::string::npos);
  const auto back = command::parse_reply(line);
  RC_ASSERT(back.status == status);
  RC_ASSERT(back.lines == reply.lines);
  RC_ASSERT(back.error == "because");
  RC_ASSERT(Json::parse(back.json) == Json::parse(reply.json));
}

TEST(ControlPath, LiesWithItsOwnerAndKnowsItsMachine) {
  const char* const runtime = std::getenv("XDG_RUNTIME_DIR");
  const std::optional<std::string> before = runtime == nullptr ? std::nullopt : std::optional<std::string>(runtime);
  ::unsetenv("XDG_RUNTIME_DIR");
  EXPECT_EQ(command::control_path("five slaves"), "/tmp/berth-" + std::to_string(::getuid()) + "/five_slaves.sock");
  EXPECT_EQ(command::control_path("../x"), "/tmp/berth-" + std::to_string(::getuid()) + "/.._x.sock");
  ::setenv("XDG_RUNTIME_DIR", "/tmp", 1);
  EXPECT_EQ(command::control_path("m"), "/tmp/berth-m.sock");
  ::setenv("XDG_RUNTIME_DIR", "/no/such/folder", 1);
  EXPECT_EQ(command::control_path("m"), "/tmp/berth-" + std::to_string(::getuid()) + "/m.sock");
  ::unsetenv("XDG_RUNTIME_DIR");
  if (before) ::setenv("XDG_RUNTIME_DIR", before->c_str(), 1);
}

// /tmp/berth-UID is whoever's who made it first: a client asks nothing of what listens in a stranger's folder.
TEST(ControlPath, AFolderThatOthersCanWriteToIsNotBelieved) {
  const std::string folder = "/tmp/berth-" + std::to_string(::getuid());
  struct stat before {};
  const bool there = ::stat(folder.c_str(), &before) == 0;
  ASSERT_TRUE(there || ::mkdir(folder.c_str(), 0700) == 0);
  ASSERT_EQ(::chmod(folder.c_str(), 0777), 0);
  const auto reply = command::control_call(folder + "/m.sock", {"report", {}}, 100);
  ASSERT_EQ(::chmod(folder.c_str(), 0700), 0);
  if (!there) ::rmdir(folder.c_str());
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "other users have access to this folder")) << reply.error();
}

/// Listens as a stranger might, in a process of its own, and does `with` what it accepts.
class Listener {
 public:
  Listener(const std::string& path, uid_t as, const std::function<void(int)>& with) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    ::chmod(path.c_str(), 0777);
    child_ = ::fork();
    if (child_ == 0) {
      // The credentials that a peer sees are those at the time of listen(2).
      if (as != ::geteuid() && ::setuid(as) != 0) ::_exit(1);
      ::listen(fd, 8);
      ::kill(::getpid(), SIGSTOP);
      for (int client = 0; (client = ::accept(fd, nullptr, nullptr)) >= 0; ::close(client)) with(client);
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(child_, &status, WUNTRACED);
    ::kill(child_, SIGCONT);
    ::close(fd);
  }
  ~Listener() {
    ::kill(child_, SIGKILL);
    ::waitpid(child_, nullptr, 0);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

 private:
  pid_t child_ = -1;
};

TEST(ControlPath, AnotherUsersProcessIsNotAsked) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root: only root can be a stranger to itself";
  const Folder folder;
  const std::string path = folder.file("s");
  constexpr uid_t stranger = 65534;
  const Listener listener(path, stranger, [](int fd) {
    constexpr std::string_view lie = "{\"status\": 0, \"reply\": {}, \"lines\": [\"all is well\"], \"error\": \"\"}\n";
    static_cast<void>(::write(fd, lie.data(), lie.size()) == 0);
  });
  const auto reply = command::control_call(path, {"report", {}}, 5000);
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "another user (65534)")) << reply.error();
}

TEST(ControlPath, AnAnswerWithoutEndIsGivenUp) {
  const Folder folder;
  const std::string path = folder.file("s");
  const Listener listener(path, ::geteuid(), [](int fd) {
    const std::string much(65536, 'x');
    for (int i = 0; i < 320 && ::send(fd, much.data(), much.size(), MSG_NOSIGNAL) > 0;
         ++i) {  // 20 MiB, and no line end
    }
  });
  const auto reply = command::control_call(path, {"report", {}}, 60'000);
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "more than 16777216 bytes")) << reply.error();
}

TEST(ControlPath, ALongOneIsRefusedInWords) {
  const auto reply = command::control_call("/tmp/" + std::string(200, 'x'), {"report", {}}, 100);
  ASSERT_FALSE(reply);
  EXPECT_TRUE(contains(reply.error(), "--control"));
}

}  // namespace
}  // namespace berth::test
