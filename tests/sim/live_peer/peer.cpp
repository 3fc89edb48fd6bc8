// Drives a robot over Fast DDS until its odometry says that it moved: peer DOMAIN.
// Prints one line of JSON: what it heard, and how far the robot went.
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include "RosPubSubTypes.h"

using namespace eprosima::fastdds::dds;

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
    auto reader = [&](const char* name, TypeSupport type) {
        type.register_type(participant);
        return subscriber->create_datareader(
            participant->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT), reads);
    };
    auto* clocks = reader(
        "rt/clock", TypeSupport(new rosgraph_msgs::msg::dds_::Clock_PubSubType()));
    auto* poses = reader("rt/odom", TypeSupport(new nav_msgs::msg::dds_::Odometry_PubSubType()));
    auto* scans = reader(
        "rt/scan", TypeSupport(new sensor_msgs::msg::dds_::LaserScan_PubSubType()));
    TypeSupport twist(new geometry_msgs::msg::dds_::Twist_PubSubType());
    twist.register_type(participant);
    auto* commands = publisher->create_datawriter(
        participant->create_topic("rt/cmd_vel", twist.get_type_name(), TOPIC_QOS_DEFAULT),
        DATAWRITER_QOS_DEFAULT);

    geometry_msgs::msg::dds_::Twist_ ahead;
    ahead.linear().x(0.2);
    rosgraph_msgs::msg::dds_::Clock_ clock;
    nav_msgs::msg::dds_::Odometry_ odometry;
    sensor_msgs::msg::dds_::LaserScan_ scan;
    SampleInfo info;
    int ticks = 0;
    size_t rays = 0;
    // At most ten minutes: nobody is left waiting for good.
    for (int turn = 0; ticks == 0 || rays == 0 || odometry.pose().pose().position().x() < 0.1; ++turn)
    {
        if (turn == 12000)
        {
            std::cerr << "it does not move" << std::endl;
            return 1;
        }
        commands->write(&ahead);
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        while (clocks->take_next_sample(&clock, &info) == ReturnCode_t::RETCODE_OK)
        {
            ticks += info.valid_data;
        }
        while (poses->take_next_sample(&odometry, &info) == ReturnCode_t::RETCODE_OK) {}
        while (scans->take_next_sample(&scan, &info) == ReturnCode_t::RETCODE_OK)
        {
            rays = scan.ranges().size();
        }
    }
    std::cout << "{\"clocks\": " << ticks << ", \"rays\": " << rays
              << ", \"x\": " << odometry.pose().pose().position().x()
              << ", \"frame\": \"" << odometry.header().frame_id()
              << "\", \"child\": \"" << odometry.child_frame_id() << "\"}" << std::endl;
    return 0;
}
