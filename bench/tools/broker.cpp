#include "bench/tools/broker.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

namespace berth::bench {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view counters = "$SYS/broker/";

using NameSocket = int (*)(int, const sockaddr*, socklen_t);

// Binds or connects it to this port of 127.0.0.1.
bool name_socket(NameSocket how, int fd, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const void* const plain = &address;
  return how(fd, static_cast<const sockaddr*>(plain), sizeof address) == 0;
}

std::uint16_t free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  socklen_t size = sizeof address;
  void* const plain = &address;
  const bool known = name_socket(::bind, fd, 0) && ::getsockname(fd, static_cast<sockaddr*>(plain), &size) == 0;
  ::close(fd);
  return known ? ntohs(address.sin_port) : std::uint16_t{0};
}

bool listens(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const bool connected = name_socket(::connect, fd, port);
  ::close(fd);
  return connected;
}

std::string new_folder() {
  std::string name = (std::filesystem::temp_directory_path() / "berth-bench-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) std::abort();
  return name;
}

}  // namespace

std::string Mosquitto::program() {
  std::string folders = std::getenv("PATH") == nullptr ? "" : std::getenv("PATH");
  folders += ":/usr/sbin:/usr/local/sbin";
  std::istringstream each(folders);
  for (std::string folder; std::getline(each, folder, ':');) {
    const auto path = folder + "/mosquitto";
    if (::access(path.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(path)) return path;
  }
  return {};
}

Mosquitto::Mosquitto(unsigned queue) : folder_(new_folder()), port_(free_port()) {
  std::ofstream config(folder_ + "/broker.conf");
  config << "listener " << port_ << " 127.0.0.1\nmax_connections -1\nallow_anonymous true\npersistence false\n"
         << "log_dest none\nsys_interval 1\nset_tcp_nodelay true\nmax_queued_messages " << queue << '\n';
  if (::geteuid() == 0) config << "user root\n";  // another user could not read the folder
  config.close();
  start();
}

Mosquitto::~Mosquitto() {
  process_.reset();
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void Mosquitto::start() {
  process_ = std::make_unique<Child>(std::vector<std::string>{program(), "-c", folder_ + "/broker.conf"}, true);
  for (int i = 0; i < 1000 && !listens(port_); ++i) std::this_thread::sleep_for(5ms);
  if (listens(port_)) return;
  fmt::print(stderr, "Mosquitto did not start: {} -c {}/broker.conf\n", program(), folder_);
  std::exit(1);
}

void Mosquitto::kill() { process_->end(SIGKILL); }

Gauge::Gauge(const mqtt::Where& where) : thread_(std::move(mqtt::Thread::start().value())) {
  mqtt::Options options{.where = where, .client_id = "gauge"};
  for (const char* name :
       {"messages/received", "messages/sent", "bytes/received", "bytes/sent", "publish/messages/dropped"})
    options.subscriptions.push_back(std::string(counters) + name);
  options.subscription_qos = mqtt::Qos::at_most_once;
  client_ = std::move(mqtt::Client::start(*thread_, options, Random(1), *this).value());
}

Gauge::Reading Gauge::read() const {
  const std::scoped_lock lock(mutex_);
  auto reading = reading_;
  reading.packets_out -= own_packets_;
  reading.bytes_out -= own_bytes_;
  return reading;
}

void Gauge::message(std::string_view topic, std::span<const std::uint8_t> payload, bool) noexcept {
  const std::scoped_lock lock(mutex_);
  constexpr double around = 5;  // fixed header, topic's length, properties' length
  ++own_packets_;
  own_bytes_ += static_cast<double>(topic.size() + payload.size()) + around;
  topic.remove_prefix(std::min(counters.size(), topic.size()));
  const double value = std::atof(std::string(payload.begin(), payload.end()).c_str());
  reading_.at = std::chrono::steady_clock::now();
  if (topic == "messages/received") reading_.packets_in = value;
  if (topic == "messages/sent") reading_.packets_out = value;
  if (topic == "bytes/received") reading_.bytes_in = value;
  if (topic == "bytes/sent") reading_.bytes_out = value;
  if (topic == "publish/messages/dropped") reading_.dropped = value;
}

}  // namespace berth::bench
