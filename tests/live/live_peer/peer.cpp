// Drives a robot over Fast DDS until its odometry says that it moved: peer DOMAIN.
// Prints one line of JSON: what it heard, and how far the robot went.
#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
using SerializedPayload = eprosima::fastrtps::rtps::SerializedPayload_t;
using Bytes = std::vector<char>;

// A type by its name on the wire; its messages are CDR, read and written field by field below.
class Named : public TopicDataType
{
public:
    explicit Named(const char* name)
    {
        setName(name);
        m_typeSize = 1 << 16;
        m_isGetKeyDefined = false;
    }
    bool serialize(void* data, SerializedPayload* payload) override
    {
        auto& bytes = *static_cast<Bytes*>(data);
        payload->length = static_cast<uint32_t>(bytes.size());
        payload->encapsulation = CDR_LE;
        std::memcpy(payload->data, bytes.data(), bytes.size());
        return true;
    }
    bool deserialize(SerializedPayload* payload, void* data) override
    {
        auto* first = reinterpret_cast<char*>(payload->data);
        static_cast<Bytes*>(data)->assign(first, first + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void* data) override
    {
        return [data] { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
    }
    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

// Calls `read` with each message that came, after its time, which all of them begin with.
template <typename Read>
void take(DataReader* reader, Read read)
{
    Bytes bytes;
    SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK)
    {
        if (!info.valid_data)
        {
            continue;
        }
        eprosima::fastcdr::FastBuffer buffer(bytes.data(), bytes.size());
        Cdr message(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        message.read_encapsulation();
        int32_t seconds;
        uint32_t nanoseconds;
        message >> seconds >> nanoseconds;
        read(message);
    }
}

int main(int, char** words)
{
    DomainParticipantQos loopback;
    auto transport = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    transport->interfaceWhiteList.push_back("127.0.0.1");
    loopback.transport().use_builtin_transports = false;
    loopback.transport().user_transports.push_back(transport);
    auto* participant = DomainParticipantFactory::get_instance()->create_participant(
        static_cast<uint32_t>(std::atoi(words[1])), loopback);
    auto* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);

    DataReaderQos reads = DATAREADER_QOS_DEFAULT;
    reads.reliability().kind = RELIABLE_RELIABILITY_QOS;
    auto topic = [&](const char* name, const char* type) {
        TypeSupport(new Named(type)).register_type(participant);
        return participant->create_topic(name, type, TOPIC_QOS_DEFAULT);
    };
    auto reader = [&](const char* name, const char* type) {
        return subscriber->create_datareader(topic(name, type), reads);
    };
    auto* clocks = reader("rt/clock", "rosgraph_msgs::msg::dds_::Clock_");
    auto* poses = reader("rt/odom", "nav_msgs::msg::dds_::Odometry_");
    auto* scans = reader("rt/scan", "sensor_msgs::msg::dds_::LaserScan_");
    auto* commands = publisher->create_datawriter(
        topic("rt/cmd_vel", "geometry_msgs::msg::dds_::Twist_"), DATAWRITER_QOS_DEFAULT);

    eprosima::fastcdr::FastBuffer buffer;
    Cdr twist(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    twist.serialize_encapsulation();
    twist << 0.2 << 0.0 << 0.0 << 0.0 << 0.0 << 0.0;  // linear, angular
    Bytes ahead(twist.getBufferPointer(), twist.getBufferPointer() + twist.getSerializedDataLength());

    int ticks = 0;
    std::vector<float> ranges;
    std::string frame, child;
    double x = 0.0;
    // At most ten minutes: nobody is left waiting for good.
    for (int turn = 0; ticks == 0 || ranges.empty() || x < 0.1; ++turn)
    {
        if (turn == 12000)
        {
            std::cerr << "it does not move" << std::endl;
            return 1;
        }
        commands->write(&ahead);
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        take(clocks, [&](Cdr&) { ++ticks; });
        take(poses, [&](Cdr& message) { message >> frame >> child >> x; });
        take(scans, [&](Cdr& message) {
            std::string of;
            std::array<float, 7> limits;  // angles, times and ranges
            message >> of >> limits >> ranges;
        });
    }
    std::cout << "{\"clocks\": " << ticks << ", \"rays\": " << ranges.size() << ", \"x\": " << x
              << ", \"frame\": \"" << frame << "\", \"child\": \"" << child << "\"}" << std::endl;
    return 0;
}
