#include "berth/io/plant_port.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <atomic>
#include <thread>

#include "../no_descriptors.hpp"
#include "berth/io/plant_protocol.hpp"
#include "berth/io/plant_socket.hpp"
#include "berth/sim/world.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;

// ---- the protocol's bytes ----

can::Frame any_frame(Random& r) {
  can::Frame f;
  f.extended = r.below(2) == 0;
  f.id = static_cast<std::uint32_t>(r.below((f.extended ? can::extended_mask : can::base_mask) + 1ULL));
  f.remote = r.below(4) == 0;
  f.size = static_cast<std::uint8_t>(r.below(9));
  for (auto& b : f.data) b = static_cast<std::uint8_t>(r.below(256));
  return f;
}

TEST(PlantProtocol, BytesAsDocumented) {
  Message m{.kind = MessageKind::send};
  m.tag = 0x01020304;
  m.frame = can::Frame::base(0x7E5, {0x04, 0x01});
  EXPECT_EQ(encode(m), (std::vector<std::uint8_t>{'S', 4, 3, 2, 1, 0xE5, 0x07, 0, 0, 0, 2, 0x04, 0x01}));
  Message hello{.kind = MessageKind::hello};
  hello.text = "ab";
  EXPECT_EQ(encode(hello), (std::vector<std::uint8_t>{'H', 2, 'a', 'b'}));
  Message listen{.kind = MessageKind::listen};
  listen.ranges = {{0x701, 0x77F}};
  EXPECT_EQ(encode(listen), (std::vector<std::uint8_t>{'L', 1, 7, 0, 0, 0x7F, 7, 0, 0}));
  Message gone{.kind = MessageKind::changed};
  gone.status.bit_rate = 0x1E848;
  gone.status.tec = 0x102;
  gone.status.bus_off = gone.status.up = gone.status.knows_errors = true;
  gone.status.errors = 0x0A0B0C;
  EXPECT_EQ(encode(gone), (std::vector<std::uint8_t>{'c', 0x48, 0xE8, 1, 0, 2, 1, 0, 0, 0x0C, 0x0B, 0x0A, 0, 38}));
}

TEST(PlantProtocol, FramesComeBackEqual) {
  Random r(5);
  for (int i = 0; i < 20'000; ++i) {
    Message m{.kind = r.below(2) == 0 ? MessageKind::send : MessageKind::received};
    m.frame = any_frame(r);
    m.tag = static_cast<std::uint32_t>(r.below(1ULL << 32U));
    const auto back = decode(encode(m));
    ASSERT_TRUE(back);
    EXPECT_EQ(back->kind, m.kind);
    EXPECT_EQ(back->frame, m.frame);
    EXPECT_EQ(back->tag, m.kind == MessageKind::send ? m.tag : 0U);
  }
}

// Whatever comes is either exactly one message, which encodes to the same bytes, or nothing.
TEST(PlantProtocol, AnyBytesAreOneMessageOrNone) {
  Random r(9);
  unsigned good = 0;
  constexpr std::string_view kinds = "HSXLRWErsqc?";
  for (int i = 0; i < 200'000; ++i) {
    std::vector<std::uint8_t> bytes(r.below(24));
    for (auto& b : bytes) b = static_cast<std::uint8_t>(r.below(r.below(2) == 0 ? 3 : 256));
    if (!bytes.empty()) bytes[0] = static_cast<std::uint8_t>(kinds[r.below(kinds.size())]);
    const auto m = decode(bytes);
    if (!m) continue;
    ++good;
    // What a remote frame's unused flags or a status's spare bits held is not kept.
    const auto again = decode(encode(*m));
    ASSERT_TRUE(again);
    EXPECT_EQ(again->frame, m->frame);
    EXPECT_EQ(again->tag, m->tag);
    EXPECT_EQ(again->ranges, m->ranges);
  }
  EXPECT_GT(good, 1000U);
}

TEST(PlantProtocol, WrongBytesAreRefused) {
  const std::vector<std::vector<std::uint8_t>> wrong{
      {},
      {'?'},
      {'H'},
      {'H', 1, 'a'},                              // another version
      {'S', 1, 0, 0, 0, 1, 0, 0, 0, 0, 9},        // size 9
      {'S', 1, 0, 0, 0, 0, 8, 0, 0, 0, 0},        // an 11-bit identifier of 800h
      {'S', 1, 0, 0, 0, 0, 0, 0, 0xA0, 0, 0},     // a 29-bit one of 2000 0000h
      {'S', 1, 0, 0, 0, 1, 0, 0, 0, 2, 0},        // unknown flag
      {'S', 1, 0, 0, 0, 1, 0, 0, 0, 0, 1},        // a byte is missing
      {'S', 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0xAA},  // a remote frame has no data
      {'X', 1, 0, 0},
      {'X', 1, 0, 0, 0, 0},
      {'L', 1, 0, 0, 0},
      {'q', 1, 0, 0, 0, 5},
  };
  for (const auto& bytes : wrong) EXPECT_FALSE(decode(bytes)) << ::testing::PrintToString(bytes);
  std::vector<std::uint8_t> many(1 + 8 * (most_ranges + 1), 0);
  many[0] = 'L';
  EXPECT_FALSE(decode(many));
}

// ---- a plant's bus and nodes in other processes, here in one thread ----

class Ear final : public can::Listener {
 public:
  void received(const can::Frame& f, rt::Time) noexcept override { log.push_back("< " + can::to_string(f)); }
  void sent(std::uint32_t tag, rt::Time) noexcept override { log.push_back("sent " + std::to_string(tag)); }
  void changed(const can::Status& s, rt::Time) noexcept override {
    log.push_back(s.up ? "up" : "down");
    last = s;
  }
  std::vector<std::string> log;
  can::Status last;
};

constexpr can::IdRange everything[] = {can::all_base, can::all_extended};

class PlantPortTest : public ::testing::Test {
 protected:
  PlantPortTest() : path_("/tmp/berth-io-" + std::to_string(::getpid()) + ".sock") {
    bus_ = &world_.add_bus("backbone", 500'000);
    peer_ = bus_->attach({.name = "peer"});
    peer_->listen(&peer_ear_, everything);
    serve();
  }
  ~PlantPortTest() override { ::unlink(path_.c_str()); }

  void serve() {
    auto made = PlantServer::listen(loop_, path_,
                                    [this](const std::string& bus, std::string& why) -> std::unique_ptr<can::Port> {
                                      why = "no bus of this name";
                                      return bus == "backbone" ? bus_->attach({.name = "client"}) : nullptr;
                                    });
    ASSERT_TRUE(made) << made.error();
    server_ = std::move(*made);
  }
  // The greeting waits for the server: the client asks in a thread, for as long as this takes.
  std::unique_ptr<PlantPort> connect(const std::string& bus, std::string* why = nullptr) {
    tl::expected<std::unique_ptr<PlantPort>, std::string> port = tl::unexpected(std::string("none"));
    std::atomic<bool> over = false;
    std::thread client([&] {
      port = PlantPort::connect(other_loop_, path_, bus);
      over = true;
    });
    for (int i = 0; i < 2000 && !over; ++i) loop_.turn(1ms);
    client.join();
    if (!port && why != nullptr) *why = port.error();
    return port ? std::move(*port) : nullptr;
  }
  [[nodiscard]] bool socket_exists() const {
    struct stat there {};
    return ::stat(path_.c_str(), &there) == 0;
  }
  void run(int turns = 40) {
    for (int i = 0; i < turns; ++i) {
      loop_.turn(1ms);
      other_loop_.turn(1ms);
    }
  }
  // Until `done`, bounded in turns and not in time.
  template <class Done>
  bool run_until(Done done) {
    for (int i = 0; i < 5000 && !done(); ++i) run(1);
    return done();
  }

  std::string path_;
  sim::World world_;
  sim::Bus* bus_ = nullptr;
  Ear peer_ear_;
  std::unique_ptr<sim::Controller> peer_;
  Loop loop_{world_.executor()};
  rt::Executor other_;
  Loop other_loop_{other_};
  std::unique_ptr<PlantServer> server_;
};

TEST_F(PlantPortTest, FramesGoBothWaysAndOwnOnesComeBackAsSent) {
  const auto port = connect("backbone");
  ASSERT_TRUE(port);
  EXPECT_EQ(port->status().bit_rate, 500'000U);
  EXPECT_TRUE(port->status().up);
  Ear ear;
  port->listen(&ear, everything);
  EXPECT_EQ(port->send(can::Frame::base(0x601, {1, 2}), 7), can::Queued::yes);
  EXPECT_EQ(port->send(can::Frame::base(0x602, {}), 0), can::Queued::yes);
  EXPECT_EQ(port->status().queued, 2);
  ASSERT_TRUE(run_until([&] { return peer_ear_.log.size() == 2; }));
  ASSERT_TRUE(run_until([&] { return port->status().queued == 0; }));
  EXPECT_EQ(peer_ear_.log, (std::vector<std::string>{"< 601#0102", "< 602#"}));
  peer_->send(can::Frame::base(0x581, {9}), 0);
  ASSERT_TRUE(run_until([&] { return ear.log.size() == 2; }));
  EXPECT_EQ(ear.log, (std::vector<std::string>{"sent 7", "< 581#09"}));
}

TEST_F(PlantPortTest, TheFilterIsThePlants) {
  const auto port = connect("backbone");
  ASSERT_TRUE(port);
  Ear ear;
  const can::IdRange only_one[] = {can::only(0x701)};
  port->listen(&ear, only_one);
  run();
  peer_->send(can::Frame::base(0x702, {0}), 0);
  peer_->send(can::Frame::base(0x701, {0}), 0);
  ASSERT_TRUE(run_until([&] { return !ear.log.empty(); }));
  EXPECT_EQ(ear.log, (std::vector<std::string>{"< 701#00"}));
}

TEST_F(PlantPortTest, TheQueueIsBounded) {
  const auto port = connect("backbone");
  ASSERT_TRUE(port);
  for (unsigned i = 0; i < PlantPort::queue_depth; ++i) {
    EXPECT_EQ(port->send(can::Frame::base(0x100, {static_cast<std::uint8_t>(i)}), i + 1), can::Queued::yes);
  }
  EXPECT_EQ(port->send(can::Frame::base(0x100, {0}), 99), can::Queued::full);
  ASSERT_TRUE(run_until([&] { return port->status().queued == 0; }));
  EXPECT_EQ(peer_ear_.log.size(), PlantPort::queue_depth);
}

TEST_F(PlantPortTest, AWithdrawnFrameIsNotConfirmed) {
  peer_->power(false);  // nobody acknowledges: the frame stays in the queue
  const auto port = connect("backbone");
  ASSERT_TRUE(port);
  Ear ear;
  port->listen(&ear, everything);
  port->send(can::Frame::base(0x100, {1}), 5);
  port->send(can::Frame::base(0x101, {2}), 6);
  run(10);
  port->withdraw(6);
  EXPECT_EQ(port->status().queued, 1);
  run(10);
  peer_->power(true);
  port->restart(500'000);
  run();
  EXPECT_EQ(std::ranges::count(ear.log, "sent 6"), 0);
  EXPECT_EQ(std::ranges::count(peer_ear_.log, "< 101#02"), 0);
}

TEST_F(PlantPortTest, TheServersDeathIsAPortThatIsDown) {
  const auto port = connect("backbone");
  ASSERT_TRUE(port);
  Ear ear;
  port->listen(&ear, everything);
  run(5);
  server_.reset();
  ASSERT_TRUE(run_until([&] { return !port->status().up; }));
  EXPECT_EQ(ear.log.back(), "down");
  EXPECT_EQ(port->send(can::Frame::base(0x100, {}), 1), can::Queued::closed);
  EXPECT_FALSE(port->restart(500'000));
  port->withdraw(1);
  port->listen(nullptr, {});
  EXPECT_FALSE(socket_exists());
}

TEST_F(PlantPortTest, TheClientsDeathIsANodeOffTheBus) {
  auto port = connect("backbone");
  ASSERT_TRUE(port);
  EXPECT_EQ(server_->clients(), 1U);
  port.reset();
  ASSERT_TRUE(run_until([&] { return server_->clients() == 0; }));
  // Nobody else is there to acknowledge now.
  peer_->send(can::Frame::base(0x100, {}), 1);
  run();
  EXPECT_GT(peer_->errors().tec(), 0);
}

// An observer in another process sees what a controller tells, error counters included, and knows
// which errors came before a frame.
TEST_F(PlantPortTest, ErrorsAndCountersComeAlong) {
  const auto port = connect("backbone");
  ASSERT_TRUE(port);
  EXPECT_TRUE(port->status().knows_errors);
  EXPECT_EQ(port->status().errors, 0U);
  class Watch final : public can::Listener {
   public:
    explicit Watch(can::Port& port) : port_(port) {}
    void received(const can::Frame&, rt::Time) noexcept override { before.push_back(port_.status().errors); }
    void sent(std::uint32_t, rt::Time) noexcept override {}
    void changed(const can::Status&, rt::Time) noexcept override {}
    std::vector<std::uint32_t> before;

   private:
    can::Port& port_;
  } watch(*port);
  port->listen(&watch, everything);
  run();
  const auto second = bus_->attach({.name = "second"});
  bus_->inject({.trigger = {.times = 3}, .where = sim::from_start(20), .victims = {second.get()}});
  peer_->send(can::Frame::base(0x100, {1}), 0);
  ASSERT_TRUE(run_until([&] { return watch.before.size() == 1; }));
  EXPECT_EQ(watch.before[0], 3U);
  // Three errors as a receiver, one good frame.
  EXPECT_TRUE(run_until([&] { return port->status().rec == 2; }));
  EXPECT_EQ(port->status().tec, 0);
  // A frame that never becomes good: the counters come without one.
  bus_->inject({.trigger = {.times = 0}, .where = sim::from_start(20), .victims = {peer_.get()}});
  peer_->send(can::Frame::base(0x101, {1}), 0);
  EXPECT_TRUE(run_until([&] { return port->status().errors > 20; }));
}

TEST_F(PlantPortTest, ABusThatIsNotThereIsRefusedInWords) {
  std::string why;
  EXPECT_FALSE(connect("elsewhere", &why));
  EXPECT_NE(why.find("no bus of this name"), std::string::npos) << why;
  ASSERT_TRUE(run_until([&] { return server_->clients() == 0; }));
  const auto nobody = PlantPort::connect(other_loop_, path_ + "x", "backbone");
  ASSERT_FALSE(nobody);
  EXPECT_NE(nobody.error().find("berth plant"), std::string::npos) << nobody.error();
}

TEST_F(PlantPortTest, ASocketThatADeadPlantLeftIsTakenOverAndALivingOnesIsNot) {
  const auto second = PlantServer::listen(other_loop_, path_, [](const std::string&, std::string&) { return nullptr; });
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().find("another process listens"), std::string::npos);
  server_.reset();
  const int dead = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
  sockaddr_un address{};
  ASSERT_TRUE(address_of(path_, address));
  ASSERT_EQ(::bind(dead, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ::close(dead);
  ASSERT_TRUE(socket_exists());
  serve();
  EXPECT_TRUE(server_);
}

TEST_F(PlantPortTest, AStrangerWhoSendsNonsenseIsPutOutAndOthersGoOn) {
  const auto port = connect("backbone");
  ASSERT_TRUE(port);
  Random r(3);
  sockaddr_un address{};
  ASSERT_TRUE(address_of(path_, address));
  for (int i = 0; i < 50; ++i) {
    const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
    ASSERT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    if (i % 2 == 0) {
      Message hello{.kind = MessageKind::hello};
      hello.text = "backbone";
      const auto bytes = encode(hello);
      ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    }
    std::vector<std::uint8_t> junk(1 + r.below(longest_message + 50));
    for (auto& b : junk) b = static_cast<std::uint8_t>(r.below(256));
    if (i % 3 == 0) junk[0] = 'S';
    ::send(fd, junk.data(), junk.size(), MSG_NOSIGNAL);
    run(2);
    ::close(fd);
  }
  ASSERT_TRUE(run_until([&] { return server_->clients() == 1; }));
  port->send(can::Frame::base(0x123, {}), 0);
  EXPECT_TRUE(run_until([&] { return std::ranges::count(peer_ear_.log, "< 123#") == 1; }));
}

// The loop comes round while a client writes without end.
TEST_F(PlantPortTest, AFastWriterGetsItsShareOfATurn) {
  sockaddr_un address{};
  ASSERT_TRUE(address_of(path_, address));
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
  ASSERT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const auto give = [&](const Message& m) {
    const auto bytes = encode(m);
    return ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT) > 0;
  };
  const auto answers = [&] {
    std::array<std::uint8_t, longest_message> bytes{};
    unsigned count = 0;
    while (::recv(fd, bytes.data(), bytes.size(), MSG_DONTWAIT) > 0) ++count;
    return count;
  };
  Message hello{.kind = MessageKind::hello};
  hello.text = "backbone";
  ASSERT_TRUE(give(hello));
  unsigned welcomed = 0;
  ASSERT_TRUE(run_until([&] { return (welcomed += answers()) > 0; }));
  // Of no tag: each is refused at once.
  Message frame{.kind = MessageKind::send};
  frame.frame = can::Frame::base(0x123, {});
  unsigned given = 0;
  while (given < 200 && give(frame)) ++given;
  ASSERT_GT(given, 2 * PlantSocket::most_at_once) << "so many must be there at once";
  loop_.serve();
  EXPECT_LE(answers(), PlantSocket::most_at_once);
  unsigned rest = 0;
  EXPECT_TRUE(run_until([&] { return (rest += answers()) + PlantSocket::most_at_once >= given; }));
  ::close(fd);
}

// ---- seats ----

class PlantSeats : public PlantPortTest {
 protected:
  int stranger() const {
    sockaddr_un address{};
    EXPECT_TRUE(address_of(path_, address));
    const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    EXPECT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    return fd;
  }
  // By the executor's clock alone.
  void pass(rt::Duration time) {
    run(4);
    world_.executor().advance(world_.executor().now() + time);
    run(4);
  }
};

TEST_F(PlantSeats, WhoIsSilentHoldsNone) {
  const auto node = connect("backbone");
  ASSERT_TRUE(node);
  std::vector<int> silent;
  for (std::size_t i = 0; i < PlantServer::most_clients; ++i) silent.push_back(stranger());
  pass(std::chrono::seconds(11));
  EXPECT_EQ(server_->clients(), PlantServer::most_clients + 1);
  const auto late = connect("backbone");
  EXPECT_TRUE(late) << "the one that was silent for the longest makes room";
  pass(std::chrono::seconds(31));
  EXPECT_EQ(server_->clients(), 2U) << "the nodes; the silent are gone";
  EXPECT_TRUE(node->status().up);
  for (const int fd : silent) ::close(fd);
}

TEST_F(PlantSeats, WithoutDescriptorsTheListenerPauses) {
  run(4);
  ASSERT_FALSE(world_.executor().next().has_value());
  const int waits = stranger();
  bool pauses = false;
  {
    const test::NoDescriptors none;
    run(4);
    pauses = world_.executor().next().has_value();
  }
  EXPECT_TRUE(pauses) << "else the loop is told of it again and again";
  pass(std::chrono::seconds(2));
  EXPECT_EQ(server_->clients(), 1U) << "it is taken when there is room again";
  ::close(waits);
}

}  // namespace
}  // namespace berth::io
