// `berth up --studio` in a process of its own.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "../pch.hpp"
#include "berth/io/stream.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

TEST(StudioCommand, PrintsItsAddressAndKeepsTheTokenBesideTheControlSocket) {
  const Folder folder;
  const std::string file = folder.file("control") + ".token";
  Background up({"up", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--studio=127.0.0.1:0",
                 "--control", folder.file("control")});
  std::string token;
  ASSERT_TRUE(eventually([&] { return static_cast<bool>(std::getline(std::ifstream(file), token)); }));
  struct stat status {};
  ASSERT_EQ(::stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  up.signal(SIGTERM);
  const auto end = up.end();
  EXPECT_NE(end.out.find("Berth Studio at http://127.0.0.1:"), std::string::npos) << end.out << end.err;
  EXPECT_NE(end.out.find("/#token=" + token), std::string::npos) << end.out;
  EXPECT_NE(::access(file.c_str(), F_OK), 0);
}

/// A connection to the address that was printed, and how a request to it ends; -1: none was printed.
struct Asked {
  int fd = -1;
  std::string host;
  std::string token;
  [[nodiscard]] std::string text(const std::string& first_line, const std::string& body = {}) const {
    return fmt::format(
        "{} HTTP/1.1\r\nHost: {}\r\nOrigin: http://{}\r\nAuthorization: Bearer {}\r\nConnection: close\r\n"
        "Content-Length: {}\r\n\r\n{}",
        first_line, host, host, token, body.size(), body);
  }
};

Asked connected_to(const std::string& said) {
  const auto at = said.find("http://");
  const auto hash = said.find("/#token=");
  if (at == std::string::npos || hash == std::string::npos) return {};
  const auto where = io::parse_endpoint(said.substr(at + 7, hash - at - 7), 0);
  return {.fd = io::begin_connect(io::look_up(*where).value().front()),
          .host = io::to_string(*where),
          .token = said.substr(hash + 8, said.find_first_of("\n ", hash) - hash - 8)};
}

// Reads what the server answers to a snapshot request.
nlohmann::json snapshot_of(const std::string& said) {
  const Asked asked = connected_to(said);
  if (asked.fd < 0) return {};
  const int fd = asked.fd;
  const auto text = asked.text("GET /api/v1/snapshot");
  std::string in;
  std::size_t sent = 0;
  static_cast<void>(eventually([&] {
    if (sent < text.size()) {
      const auto n = ::send(fd, text.data() + sent, text.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n > 0) sent += static_cast<std::size_t>(n);
    }
    char buffer[65536];
    const auto n = ::recv(fd, buffer, sizeof buffer, MSG_DONTWAIT);
    if (n > 0) in.append(buffer, static_cast<std::size_t>(n));
    return n == 0;
  }));
  ::close(fd);
  const auto body = in.find("\r\n\r\n");
  return body == std::string::npos ? nlohmann::json() : nlohmann::json::parse(in.substr(body + 4), nullptr, false);
}

// What Studio has kept, by the control socket in several parts: each frame once, in order, and as it was recorded.
TEST(StudioCommand, TheRingIsReadByACommand) {
  const Folder folder;
  const std::string machine = folder.write("machine.toml", small_machine);
  const std::string socket = folder.file("control");
  const std::string ring = folder.file("ring.log");
  Background up({"up", machine, "--sim", folder.write("plant.toml", small_plant), "--studio=127.0.0.1:0", "--control",
                 socket, "--record", folder.file("all.log")});
  ASSERT_TRUE(up.says("/#token="));
  const auto trace = [&](Words more) {
    Words words{"trace", "-m", machine, "--control", socket, "--ring", "-o", ring, "--force", "--json"};
    words.insert(words.end(), more.begin(), more.end());
    const auto out = berth(words);
    EXPECT_EQ(out.status, 0) << out.out << out.err;
    return nlohmann::json::parse(out.out, nullptr, false).value("frames", std::uint64_t{0});
  };
  ASSERT_EQ(berth({"world", "speed", "300", "--control", socket}).status, 0);
  ASSERT_TRUE(eventually([&] { return trace({}) > 10'000; }));
  ASSERT_EQ(berth({"world", "pause", "--control", socket}).status, 0);
  const auto frames = trace({"--filter", "LINE 702#"});
  const std::string of_one = contents(ring);
  const auto all = trace({});
  std::istringstream lines(contents(ring));
  std::string filtered;
  std::uint64_t count = 0;
  for (std::string line; std::getline(lines, line); ++count)
    if (line.find(" line 702#") != std::string::npos) filtered += line + "\n";
  EXPECT_EQ(count, all);
  EXPECT_GT(frames, 100U);
  EXPECT_TRUE(of_one == filtered) << frames << " frames by the filter";
  EXPECT_EQ(trace({"--no-directions"}), all) << "a record has no directions";
  const auto audit = berth({"history", "--audit", "--control", socket});
  EXPECT_EQ(audit.out.find("ring"), std::string::npos) << "it changes nothing: " << audit.out;
  up.signal(SIGTERM);
  static_cast<void>(up.end());
  ASSERT_EQ(berth({"trace", folder.file("all.log"), "-o", folder.file("recorded.log")}).status, 0);
  // A record has no error frames, whose identifier has bit 29.
  std::istringstream kept(contents(ring));
  std::string good;
  for (std::string line; std::getline(kept, line);) {
    const auto id = line.find(' ', line.find(' ') + 1) + 1;
    const bool error = line.find('#') - id == 8 && (line[id] == '2' || line[id] == '3');
    if (!error) good += line + "\n";
  }
  EXPECT_TRUE(contents(folder.file("recorded.log")).starts_with(good));
}

TEST(StudioCommand, WhereThereIsNoRingThatIsSaid) {
  const Folder folder;
  const std::string machine = folder.write("machine.toml", small_machine);
  const std::string socket = folder.file("control");
  const auto nobody = berth({"trace", "-m", machine, "--control", socket, "--ring"});
  EXPECT_EQ(nobody.status, 3) << nobody.err;
  Background up({"up", machine, "--sim", folder.write("plant.toml", small_plant), "--pace", "--control", socket});
  ASSERT_TRUE(eventually([&] { return berth({"status", "--control", socket}).status <= 1; }));
  const auto none = berth({"trace", "-m", machine, "--control", socket, "--ring"});
  EXPECT_EQ(none.status, 1);
  EXPECT_NE(none.err.find("start it with --studio"), std::string::npos) << none.err;
  EXPECT_EQ(berth({"trace", folder.file("x.log"), "--ring"}).status, 2);
  const auto filter = berth({"trace", "-m", machine, "--control", socket, "--filter", "abort"});
  EXPECT_EQ(filter.status, 2);
  EXPECT_NE(filter.err.find("--filter is for --ring"), std::string::npos) << filter.err;
}

// A page's request is under way, for the world stands, when the process is killed: the store says that it was begun,
// has the bindings, and serves the next start.
TEST(StudioCommand, ACrashLeavesWhatWasBegunInTheAuditLog) {
  const Folder folder;
  const std::string machine = folder.write("machine.toml", small_machine);
  const std::string plant = folder.write("plant.toml", small_plant);
  const std::string socket = folder.file("control");
  const std::string store = folder.file("slots.db");
  const auto audit = [&](const Words& of) {
    Words words{"history", "--audit", "--json"};
    words.insert(words.end(), of.begin(), of.end());
    const auto out = berth(words);
    EXPECT_EQ(out.status, 0) << out.out << out.err;
    return nlohmann::json::parse(out.out, nullptr, false).value("audit", nlohmann::json::array());
  };
  const auto up_words =
      Words{"up", machine, "--sim", plant, "--studio=127.0.0.1:0", "--control", socket, "--store", store};
  {
    Background up(up_words);
    ASSERT_TRUE(up.says("/#token="));
    ASSERT_TRUE(eventually([&] { return berth({"status", "--control", socket}).status == 0; }));
    ASSERT_EQ(berth({"world", "pause", "--control", socket}).status, 0);
    const Asked asked = connected_to(up.said());
    const auto text = asked.text("POST /api/v1/request",
                                 R"({"verb":"sdo write","arguments":{"node":"drive","object":"1017h","value":"250"}})");
    std::size_t sent = 0;
    ASSERT_TRUE(eventually([&] {
      const auto n = ::send(asked.fd, text.data() + sent, text.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n > 0) sent += static_cast<std::size_t>(n);
      return sent == text.size();
    }));
    ASSERT_TRUE(eventually([&] { return audit({"--control", socket}).dump().find("sdo write") != std::string::npos; }));
    up.signal(SIGKILL);
    EXPECT_EQ(up.end().status, 128 + SIGKILL);
    ::close(asked.fd);
  }
  const auto last = [&] { return audit({machine, "--store", store}).back(); };
  EXPECT_EQ(last().at("what"), "sdo write node=drive object=1017h value=250");
  EXPECT_EQ(last().at("answer"), "begun");
  EXPECT_TRUE(last().at("who").get<std::string>().starts_with("studio, client ")) << last();
  const auto history = berth({"history", "drive", machine, "--store", store});
  EXPECT_EQ(history.status, 0) << history.err;
  EXPECT_NE(history.out.find("confirmed"), std::string::npos) << history.out;
  Background again(up_words);
  ASSERT_TRUE(eventually([&] { return berth({"status", "--control", socket}).status == 0; }));
  ASSERT_EQ(berth({"world", "speed", "1", "--control", socket}).status, 0);
  again.signal(SIGTERM);
  static_cast<void>(again.end());
  EXPECT_EQ(last().at("what"), "world speed factor=1") << "it is written on";
  EXPECT_EQ(last().at("answer"), "done");
}

// `berth studio MACHINE --sim PLANT` is `berth up --studio`: paced, and up until a signal comes.
TEST(StudioCommand, AMachineInTheBrowser) {
  const Folder folder;
  Background studio({"studio", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--listen",
                     "127.0.0.1:0", "--control", folder.file("control")});
  ASSERT_TRUE(studio.says("Berth Studio at http://127.0.0.1:"));
  ASSERT_TRUE(studio.says("/#token="));
  const auto snapshot = snapshot_of(studio.said());
  ASSERT_TRUE(snapshot.is_object());
  EXPECT_EQ(snapshot.at("machine").at("simulated"), true);
  EXPECT_EQ(berth({"status", "--control", folder.file("control")}).status, 1) << "not operational yet, and it answers";
  studio.signal(SIGINT);
  static_cast<void>(studio.end());
}

TEST(StudioCommand, TheDemoInTheBrowser) {
  const Folder folder;
  Background demo({"demo", "--studio=127.0.0.1:0", "--control", folder.file("control")});
  ASSERT_TRUE(demo.says("Berth Studio at http://127.0.0.1:"));
  EXPECT_TRUE(demo.says("-- From blank to operational."));
  EXPECT_EQ(berth({"status", "--control", folder.file("control")}).status, 0) << "it stays";
  demo.signal(SIGINT);
  EXPECT_EQ(demo.end().status, 0);
}

// One bus without a machine file: nothing is brought up, and its devices can be asked.
TEST(StudioCommand, ABusByItself) {
  const Folder folder;
  const std::string machine = folder.write("machine.toml", small_machine);
  const std::string plant = folder.write("plant.toml", small_plant);
  const std::string socket = folder.file("plant.sock");
  Background alone({"plant", plant, "--listen", socket, "--machine", machine});
  ASSERT_TRUE(alone.says("Ctrl-C ends it"));
  Background studio({"studio", "--port", "plant:" + socket, "--bus", "line", "--listen", "127.0.0.1:0"});
  ASSERT_TRUE(studio.says("/#token="));
  const auto snapshot = snapshot_of(studio.said());
  ASSERT_TRUE(snapshot.is_object());
  EXPECT_TRUE(snapshot.at("slots").empty());
  EXPECT_EQ(snapshot.at("buses").size(), 1U);
  studio.signal(SIGTERM);
  EXPECT_EQ(studio.end().status, 0);
  EXPECT_EQ(berth({"studio", "--port", "plant:" + folder.file("none")}).status, 3);
}

// The role's own address, and tokens that a second start has again.
TEST(StudioCommand, AnAddressForARoleAndTokensThatStay) {
  const Folder folder;
  std::string first;
  for (int start = 0; start < 2; ++start) {
    Background studio({"studio", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--listen",
                       "127.0.0.1:0", "--role", "view", "--tokens", folder.file("tokens"), "--control",
                       folder.file("control")});
    ASSERT_TRUE(studio.says("Berth Studio, role view, at http://127.0.0.1:"));
    const auto said = studio.said();
    const auto lines = said.substr(said.find("Berth Studio, role view, at "));
    EXPECT_EQ(snapshot_of(said).at("role"), "configure");
    EXPECT_EQ(snapshot_of(lines).at("role"), "view");
    const auto token = lines.substr(lines.find("#token="), 7 + 64);
    if (start == 0) first = token;
    EXPECT_EQ(token, first);
    studio.signal(SIGINT);
    static_cast<void>(studio.end());
  }
}

int run(const std::string& command) {
  return WEXITSTATUS(std::system(command.c_str()));  // NOLINT(concurrency-mt-unsafe): nothing else runs here
}

// Other addresses are refused without a certificate, with the command that makes one; and that one is taken.
TEST(StudioCommand, TheCertificateThatTheRefusalMakesIsTaken) {
  if (run("command -v openssl >/dev/null") != 0) GTEST_SKIP() << "no openssl";
  const Folder folder;
  const auto machine = example("five-slaves.toml");
  const auto plant = example("five-slaves.plant.toml");
  const auto refused = berth({"studio", machine, "--sim", plant, "--listen", "0.0.0.0:0"});
  EXPECT_EQ(refused.status, 3);
  const auto begin = refused.err.find("openssl req");
  ASSERT_NE(begin, std::string::npos) << refused.err;
  const auto command = refused.err.substr(begin, refused.err.find(". Or") - begin);
  ASSERT_EQ(run("cd '" + folder.file("") + "' && " + command + " 2>made || { cat made; false; }"), 0) << command;
  const std::string certificate = folder.file("studio.crt"), key = folder.file("studio.key");
  Background studio({"studio", machine, "--sim", plant, "--listen", "0.0.0.0:0", "--certificate", certificate, "--key",
                     key, "--control", folder.file("control")});
  ASSERT_TRUE(studio.says("Berth Studio at https://"));
  studio.signal(SIGINT);
  static_cast<void>(studio.end());
  ASSERT_EQ(::chmod(key.c_str(), 0644), 0);
  const auto open = berth({"studio", machine, "--sim", plant, "--certificate", certificate, "--key", key});
  EXPECT_EQ(open.status, 3);
  EXPECT_NE(open.err.find("chmod 600"), std::string::npos) << open.err;
  EXPECT_EQ(berth({"studio", machine, "--sim", plant, "--certificate", certificate}).status, 2);
}

// Python's ssl, curl and openssl s_client; old versions, other hosts, plain HTTP, and handshakes that stop
// (tls_peer.py).
TEST(StudioCommand, TlsBeforeItsPeers) {
  if (run("command -v openssl >/dev/null && command -v python3 >/dev/null") != 0)
    GTEST_SKIP() << "no openssl or python3";
  const Folder folder;
  const std::string certificate = folder.file("studio.crt"), key = folder.file("studio.key");
  ASSERT_EQ(
      run("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=berth -addext "
          "subjectAltName=DNS:plant.example -keyout '" +
          key + "' -out '" + certificate + "' 2>/dev/null"),
      0);
  Background studio({"studio", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--listen",
                     "127.0.0.1:0", "--certificate", certificate, "--key", key, "--control", folder.file("control")});
  ASSERT_TRUE(studio.says("/#token="));
  const auto said = studio.said();
  const auto at = said.find("https://127.0.0.1:");
  ASSERT_NE(at, std::string::npos) << said;
  const auto hash = said.find("/#token=", at);
  const auto port = said.substr(at + 18, hash - at - 18);
  EXPECT_EQ(run("python3 '" + source_dir() + "/tests/cli/tls_peer.py' " + port + " '" + certificate + "' " +
                said.substr(hash + 8, 64) + " plant.example"),
            0)
      << "see what it printed above";
  studio.signal(SIGINT);
  static_cast<void>(studio.end());
}

// A bus outside this process (socketcand) is a real one: a page reads there, and changes it while it is unlocked only.
TEST(StudioCommand, ARealBusIsReadOnlyUntilAPersonUnlocksIt) {
  if (run("command -v python3 >/dev/null") != 0) GTEST_SKIP() << "no python3";
  const Folder folder;
  const int fd = io::listen_tcp({"127.0.0.1", 0}).value();
  const auto where = io::to_string(*io::local_endpoint(fd));
  ::close(fd);
  const std::string plant = folder.write("plant.toml",
                                         "[plant]\nseed = 1\n[bus.line]\nbitrate = 125000\n[[device]]\nbus = "
                                         "\"line\"\nname = \"a\"\ntype = { vendor = 1, product = 1 }\nserial = "
                                         "1\nnode_id = 5\n");
  Background server({"serve", plant, "--listen", where});
  ASSERT_TRUE(server.says("socketcand://"));
  Background studio(
      {"studio", "--port", "socketcand://" + where + "/line", "--bitrate", "125000", "--listen", "127.0.0.1:0"});
  ASSERT_TRUE(studio.says("/#token="));
  const auto said = studio.said();
  const auto at = said.find("http://127.0.0.1:") + 17;
  const auto hash = said.find("/#token=", at);
  EXPECT_EQ(run("python3 '" + source_dir() + "/tests/cli/lock_peer.py' " + said.substr(at, hash - at) + " " +
                said.substr(hash + 8, 64) + " 5"),
            0)
      << "see what it printed above";
  studio.signal(SIGINT);
  static_cast<void>(studio.end());
}

TEST(StudioCommand, WrongUse) {
  const auto machine = example("five-slaves.toml");
  const auto plant = example("five-slaves.plant.toml");
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--studio", "--fast"}).status, 2);
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--studio=nowhere:99999"}).status, 2);
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--studio", "--studio-role", "owner"}).status, 2);
  const auto without = berth({"up", machine, "--sim", plant, "--studio-role", "view"});
  EXPECT_EQ(without.status, 2);
  EXPECT_NE(without.err.find("--studio"), std::string::npos) << without.err;
  const auto anywhere = berth({"up", machine, "--sim", plant, "--studio=0.0.0.0:0"});
  EXPECT_EQ(anywhere.status, 3);
  EXPECT_NE(anywhere.err.find("TLS"), std::string::npos) << anywhere.err;
  const int taken = io::listen_tcp({"127.0.0.1", 0}).value();
  const auto where = io::to_string(*io::local_endpoint(taken));
  const auto refused = berth({"up", machine, "--sim", plant, "--studio=" + where});
  EXPECT_EQ(refused.status, 3);
  EXPECT_NE(refused.err.find(where), std::string::npos) << refused.err;
  ::close(taken);
}

// Nobody named a port: the next free one is taken, and that is said.
TEST(StudioCommand, ATakenPortIsSaidAndTheNextIsOffered) {
  const Folder folder;
  const auto usual = io::listen_tcp({"127.0.0.1", 8302});  // else another program has it, which is as good
  Background up({"up", folder.write("machine.toml", small_machine), "--sim", folder.write("plant.toml", small_plant),
                 "--studio", "--control", folder.file("control")});
  ASSERT_TRUE(up.says("/#token="));
  EXPECT_NE(up.said().find("Port 8302 is taken, perhaps by another Studio: this one is at 83"), std::string::npos)
      << up.said();
  EXPECT_EQ(up.said().find("http://127.0.0.1:8302/"), std::string::npos) << up.said();
  EXPECT_TRUE(snapshot_of(up.said()).is_object());
  up.signal(SIGTERM);
  static_cast<void>(up.end());
  if (usual) ::close(*usual);
}

}  // namespace
}  // namespace berth::test
