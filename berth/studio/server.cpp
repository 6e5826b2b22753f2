// asio/awaitable.hpp of Boost 1.74 uses std::exchange without this.
#include <utility>

#include "berth/can/length.hpp"
#include "berth/studio/server_parts.hpp"

#include <fmt/format.h>

#include <boost/asio/post.hpp>
#include <nlohmann/json.hpp>

namespace berth::studio {

void Rates::tick(std::chrono::steady_clock::time_point now) {
  buses_.resize(mirror_->buses().size());
  traffic_.resize(buses_.size());
  RingFrame frame;
  const auto next = ring_->next();
  for (auto n = std::max(counted_, ring_->first()); n < next; ++n) {
    if (!ring_->read(n, frame) || frame.error || frame.bus >= buses_.size()) continue;
    const unsigned bits = can::exact_bits(frame.frame);
    ++buses_[frame.bus].frames;
    buses_[frame.bus].bits += bits;
    traffic_[frame.bus].add(frame.frame, bits, mirror_->bit_rates()[frame.bus]);
  }
  counted_ = next;
  const double clock = std::chrono::duration<double>(now - since_).count();
  if (clock < 1) return;
  const double passed = clock * mirror_->pace().speed;  // in the world's time
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    Bus& bus = buses_[i];
    bus.per_s = static_cast<double>(bus.frames) / passed;
    bus.load = std::min(1.0, static_cast<double>(bus.bits) / passed / mirror_->bit_rates()[i]);
    traffic_[i].load = bus.load;
    const auto all = errors(i);
    bus.errors_per_s = static_cast<double>(all - bus.errors) / passed;
    bus.errors = all;
    bus.frames = bus.bits = 0;
  }
  since_ = now;
}

std::uint64_t Rates::errors(std::size_t bus) const noexcept {
  return bus < Link::most_buses ? link_->health[bus].errors.load(std::memory_order_relaxed) : 0;
}

std::string Rates::json(std::uint64_t left_out, double time_s) const {
  auto buses = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    buses.push_back({{"bus", mirror_->buses()[i]},
                     {"frames_per_s", buses_[i].per_s},
                     {"load", buses_[i].load},
                     {"errors_per_s", buses_[i].errors_per_s},
                     {"errors", errors(i)}});
    if (i >= Link::most_buses) continue;
    const auto state = BusHealth::unpacked(link_->health[i].state.load(std::memory_order_relaxed));
    if (!state) continue;
    buses.back()["state"] = state->word();
    if (!state->counts) continue;
    buses.back()["tec"] = state->tec;
    buses.back()["rec"] = state->rec;
  }
  return fmt::format(R"({{"type":"rates","buses":{},"ring":{{"first":{},"next":{}}},"left_out":{},"world":{}}})",
                     buses.dump(), ring_->first(), ring_->next(), left_out, mirror_->world_json(time_s));
}

Scrape::Scrape(const Mirror& mirror, const Rates& rates)
    : mirror_(&mirror),
      rates_(&rates),
      start_s_(std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count()) {}

void Scrape::take(std::shared_ptr<const Figures> figures) {
  figures_ = std::move(figures);
  taken_ = std::chrono::steady_clock::now();
}

std::string Scrape::page(Exposition exposition) const {
  static const Figures none;
  About about = mirror_->about();
  about.start_s = start_s_;
  if (figures_) about.age_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - taken_).count();
  return metrics_page(about, figures_ ? *figures_ : none, rates_->traffic(), exposition);
}

Hall::Hall(int listener, bool ipv6, std::uint16_t port, std::unique_ptr<Tls> tls, Tokens tokens, Mirror mirror,
           Link& link)
    : acceptor_(context_, ipv6 ? asio::ip::tcp::v6() : asio::ip::tcp::v4(), listener),
      bell_(context_),
      timer_(context_),
      port_(port),
      tls_(std::move(tls)),
      tokens_(std::move(tokens)),
      mirror_(std::move(mirror)),
      link_(&link),
      rates_(link, mirror_),
      scrape_(mirror_, rates_) {
  bell_.assign(::dup(link.for_server.descriptor()));
}

void Hall::run() {
  accept();
  listen_for_news();
  tick();
  context_.run();
  clients_.clear();
}

void Hall::stop() { context_.stop(); }

double Hall::time_s() const noexcept {
  const std::chrono::nanoseconds now(link_->now_ns.load(std::memory_order_relaxed));
  return std::chrono::duration<double>(now).count();
}

std::string Hall::snapshot(command::Role role) const { return mirror_.snapshot(time_s(), role); }

bool Hall::order(Order order) {
  if (!link_->orders.put(order)) return false;
  link_->for_executor.ring();
  return true;
}

void Hall::enter(const std::shared_ptr<Client>& client) { clients_[client->number()] = client; }

void Hall::leave(const Client& client) {
  const auto it = clients_.find(client.number());
  if (it == clients_.end()) return;
  const auto stays = it->second;  // keeps the client until the end of this function
  clients_.erase(it);
  gone_.push_back(client.number());
  give_gone();
}

void Hall::give_gone() {
  while (!gone_.empty() && order({.kind = Order::Kind::gone, .client = gone_.front()})) gone_.pop_front();
}

// Without free descriptors accept() fails at once: a pause keeps the thread from spinning.
void Hall::accept() {
  acceptor_.async_accept([this](boost::system::error_code error, asio::ip::tcp::socket socket) {
    if (!error) {
      accepted(std::move(socket));
      return accept();
    }
    auto pause = std::make_shared<asio::steady_timer>(context_, std::chrono::milliseconds(200));
    pause->async_wait([this, pause](boost::system::error_code) { accept(); });
  });
}

void Hall::accepted(asio::ip::tcp::socket socket) {
  boost::system::error_code ignored;
  socket.set_option(asio::ip::tcp::no_delay(true), ignored);
  if (clients_.size() >= most_clients && !make_room()) return turn_away(*this, std::move(socket));
  Wire::Plain plain(std::move(socket));
  enter(greet(*this, tls_ ? Wire(std::move(plain), tls_->context()) : Wire(std::move(plain))));
}

// The oldest client that may be dropped: an unfinished handshake or request keeps nobody out.
bool Hall::make_room() {
  for (const auto hold : {Client::Hold::idle, Client::Hold::stranger}) {
    const auto it = std::ranges::find_if(clients_, [&](const auto& client) { return client.second->hold() == hold; });
    if (it == clients_.end()) continue;
    const auto client = it->second;
    client->close();
    leave(*client);
    return true;
  }
  return false;
}

bool Hall::is_own_host(std::string_view host) const {
  if (studio::is_own_host(host, port_)) return true;
  return tls_ && tls_->names(std::string(name_in_host(host, port_)));
}

bool Hall::is_own_origin(std::string_view origin) const {
  const std::string_view scheme = tls_ ? "https://" : "http://";
  return origin.starts_with(scheme) && is_own_host(origin.substr(scheme.size()));
}

void Hall::listen_for_news() {
  bell_.async_wait(asio::posix::descriptor_base::wait_read, [this](boost::system::error_code error) {
    if (error) return;
    link_->for_server.silence();
    take_news();
    listen_for_news();
  });
}

void Hall::take_news() {
  while (auto news = link_->news.take()) {
    if (news->figures) scrape_.take(std::move(news->figures));
    auto message = mirror_.take(*news);
    if (!message.empty()) {
      const auto text = std::make_shared<const std::string>(std::move(message));
      const auto all = clients_;  // a copy: a client may leave meanwhile
      for (const auto& [number, client] : all) client->change(text);
    }
    if (!news->answer) continue;
    const auto it = clients_.find(news->answer->client);
    if (it == clients_.end()) continue;
    const auto client = it->second;
    client->answer(*news->answer);
  }
}

void Hall::tick() {
  give_gone();
  ++ticks_;
  rates_.tick(std::chrono::steady_clock::now());  // counters count without a client, too
  if (!clients_.empty()) {
    const auto all = clients_;
    for (const auto& [number, client] : all) client->tick(ticks_ % 10 == 0);
  }
  timer_.expires_after(batch_period);
  timer_.async_wait([this](boost::system::error_code error) {
    if (!error) tick();
  });
}

}  // namespace berth::studio
