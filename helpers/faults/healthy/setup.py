from glob import glob

from setuptools import find_packages, setup

package_name = 'courier'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(include=[package_name]),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/launch', glob('launch/*launch.[pxy][yma]*')),
        ('share/' + package_name + '/config', glob('config/*.yaml')),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Somebody else',
    maintainer_email='somebody@example.com',
    description='Drives a TurtleBot 3 straight on, and stops it before what is in its way',
    license='Apache-2.0',
    extras_require={'test': ['pytest']},
    entry_points={
        'console_scripts': [
            'brake = courier.brake:main',
            'manager = courier.manager:main',
            'route = courier.route:main',
        ],
    },
)
